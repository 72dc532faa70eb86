"""Files and folders that appear whole or not at all."""

import contextlib
import os
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path


class InputError(ValueError):
    """Something the user gave cannot be used; the message says what was expected, what came, and what to do."""


def read_bytes(path: str | Path) -> bytes:
    """All of the file. Raises InputError where there is none, where it cannot be read, and where it is empty."""
    path = Path(path)
    if path.is_dir():
        raise InputError(f"expected a file, but {path} is a folder")
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"there is no file {path} (looked from {Path.cwd()})") from None
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from None
    if not data:
        raise InputError(f"{path} is empty (0 bytes)")
    return data


def write_bytes(path: str | Path, data: bytes, *, force: bool = False) -> None:
    """Writes `data` under a temporary name in the same folder and renames it, so that no half file is ever seen.

    Raises InputError where the file exists (unless `force`) and where the folder cannot be written to.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"expected the name of a file to write, but {path} is a folder")
    if path.exists() and not force:
        raise InputError(f"{path} exists already; choose another name or overwrite it (--force, force=True)")
    temporary = _temporary_name(path)
    try:
        # "x": the permissions are those the user's umask gives, which tempfile's are not.
        with open(temporary, "xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror or error}") from None
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


@contextlib.contextmanager
def output_folder(path: str | Path, *, force: bool = False) -> Iterator[Path]:
    """A folder of results: `with output_folder("out") as staged:` write into `staged`, which becomes `path` at the end.

    When the block raises (Ctrl-C included) nothing remains: no files, no temporary folder, no parent made on the way.
    A folder that holds anything is left alone unless `force`; then files of the same names are replaced, all or none
    of them, and others stay. Raises InputError for a folder that must not be or cannot be written.
    """
    path = Path(path)
    if path.exists() and not path.is_dir():
        raise InputError(f"expected a folder for the results, but {path} is a file")
    if path.is_dir() and any(path.iterdir()) and not force:
        raise InputError(f"{path} exists already and is not empty; choose another folder or overwrite it (--force)")
    made: list[Path] = []
    staged = _temporary_name(Path(os.path.abspath(path)))
    try:
        try:
            for parent in reversed([p for p in staged.parents if not p.exists()]):
                parent.mkdir()
                made.append(parent)
            staged.mkdir()
        except OSError as error:
            raise InputError(f"cannot write the results to {path}: {error.strerror or error}") from None
        yield staged
        _publish(staged, path)
    except BaseException:
        shutil.rmtree(staged, ignore_errors=True)
        for parent in reversed(made):
            with contextlib.suppress(OSError):
                parent.rmdir()
        raise


def _temporary_name(path: Path) -> Path:
    """A hidden sibling: a rename within one folder never crosses file systems."""
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")


def _publish(staged: Path, path: Path) -> None:
    try:
        if not path.exists():
            os.replace(staged, path)
            return
        # Into a folder that exists: the files to be replaced are set aside first, and come back if anything fails.
        aside = _temporary_name(Path(os.path.abspath(path)))
        aside.mkdir()
        replaced: list[str] = []
        published: list[str] = []
        try:
            for name in sorted(entry.name for entry in staged.iterdir()):
                if (path / name).exists():
                    os.replace(path / name, aside / name)
                    replaced.append(name)
                os.replace(staged / name, path / name)
                published.append(name)
        except BaseException:
            for name in published:
                os.replace(path / name, staged / name)
            for name in replaced:
                os.replace(aside / name, path / name)
            raise
        finally:
            shutil.rmtree(aside, ignore_errors=True)
        staged.rmdir()
    except OSError as error:
        raise InputError(f"cannot move the results to {path}: {error.strerror or error}") from None
