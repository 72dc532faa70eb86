"""From which stored value a pixel counts as clipped, for still, moving and live pictures alike."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Bool

from jaxsfs.cli._settings import COMMAND_LINE, Setting, check_clip_limit
from jaxsfs.cli._terminal import warn
from jaxsfs.frames import Stored, common_plateau, highest_value
from jaxsfs.photo import Plateau, clipping_limit


def clip_limit(word: str, dtype: str, highest: float) -> Setting:
    """What `--clip-limit` says of a stored type and the `highest` value there is (full scale 1); None: nothing is
    clipped. Raises CannotRun for a word that it does not take."""
    own = clipping_limit(dtype)
    if word == "auto":
        return Setting(own, f"automatic, {dtype}")
    limits = {"off": None, "highest": highest or own}
    return Setting(limits[word] if word in limits else check_clip_limit(word), COMMAND_LINE)


def clipping(
    word: str, frames: list[Stored], mask: Bool[np.ndarray, "height width"]
) -> tuple[Setting, dict[str, float] | None]:
    """The same from `frames` that stand for all of a video, and the record of a plateau, which is warned of."""
    limit = clip_limit(word, str(frames[0].dtype), highest_value(frames, mask))
    flat = plateau_record(common_plateau(frames, mask, limit.value))
    if flat is not None:
        warn(plateau_warning(flat))
    return limit, flat


def plateau_record(found: Plateau | None) -> dict[str, float] | None:
    """Ready for JSON."""
    return None if found is None else found._asdict()


def plateau_warning(found: Mapping[str, Any], remedy: str = "--clip-limit highest") -> str:
    """What to say of a plateau, from its record; `remedy`: the option that makes its pixels unknown."""
    return (
        f"{found['share']:.1%} of the pixels share the highest value {found['value']:.4g} of full scale: probably "
        f"clipped, but taken as data; {remedy} takes them as unknown"
    )
