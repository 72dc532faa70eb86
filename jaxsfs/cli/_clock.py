"""How long the stages of a command took."""

import time


class Clock:
    """Seconds of the stages that were ended one after another, from `begin` (of time.perf_counter) on."""

    def __init__(self, begin: float):
        self._begin = self._last = begin
        self._laps: dict[str, float] = {}

    def lap(self, stage: str) -> None:
        """Ends a stage."""
        now = time.perf_counter()
        self._laps[stage] = now - self._last
        self._last = now

    def total(self) -> float:
        """Since the beginning."""
        return time.perf_counter() - self._begin

    def rounded(self) -> dict[str, float]:
        """Seconds by stage, to the millisecond."""
        return {stage: round(seconds, 3) for stage, seconds in self._laps.items()}
