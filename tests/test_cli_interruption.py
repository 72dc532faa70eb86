"""Ctrl-C ends a command wherever it comes."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable

import pytest
from cli_folders import reconstruct

from jaxsfs.cli import main
from jaxsfs.cli._interruption import interruptible

pytestmark = [
    pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="this platform has no SIGALRM"),
    pytest.mark.usefixtures("heeds_interrupts"),
]


def run(what: Callable[[], None]) -> None:
    with interruptible():
        what()
        time.sleep(5)  # long enough for an interrupt that comes later


def test_at_once():
    with pytest.raises(KeyboardInterrupt):
        run(lambda: os.kill(os.getpid(), signal.SIGINT))


def test_later_if_it_comes_within_a_callback_that_would_swallow_it():
    came = []

    def _xla_gc_callback():
        os.kill(os.getpid(), signal.SIGINT)
        came.append("finished")

    with pytest.raises(KeyboardInterrupt):
        run(_xla_gc_callback)
    assert came == ["finished"]


def test_afterwards_all_is_as_before():
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM)
    with interruptible():
        pass
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM)) == before


class TestInterrupted:
    @pytest.mark.parametrize("step", ["solve", "files.write_surface", "files.write_json"])
    def test_nothing_remains(self, view, tmp_path, monkeypatch, capsys, step):
        def stop(*_, **__):
            raise KeyboardInterrupt

        monkeypatch.setattr(f"jaxsfs.cli._pipeline.{step}", stop)
        assert main(reconstruct(view, tmp_path / "deep/out")) == 130
        assert list(tmp_path.iterdir()) == []
        assert capsys.readouterr().err == "jaxsfs: interrupted; nothing was written\n"

    def test_an_earlier_result_stays(self, view, result, tmp_path, monkeypatch):
        shutil.copytree(result, tmp_path / "out")

        def stop(folder, *_):
            (folder / "range.tiff").write_bytes(b"half")
            raise KeyboardInterrupt

        monkeypatch.setattr("jaxsfs.cli._pipeline.files.write_surface", stop)
        assert main(reconstruct(view, tmp_path / "out", "--force")) == 130
        assert [p.name for p in tmp_path.iterdir()] == ["out"]
        assert all((tmp_path / "out" / p.name).read_bytes() == p.read_bytes() for p in result.iterdir())

    def test_by_a_real_signal(self, view, tmp_path):
        words = [sys.executable, "-m", "jaxsfs.cli", *reconstruct(view, tmp_path / "out")]
        with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            deadline = time.monotonic() + 60
            while not list(tmp_path.iterdir()) and time.monotonic() < deadline:  # the folder it stages
                time.sleep(0.05)
            assert process.poll() is None
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=60)
        assert process.returncode == 130
        assert said == "jaxsfs: interrupted; nothing was written\n"
        assert list(tmp_path.iterdir()) == []
