"""Frames on Dask workers: a worker that dies takes nothing with it, and workers use one thread each."""

import os
import signal
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from data_synth import WavyWall, render_scene
from jaxsfs import files
from jaxsfs.cli import main
from jaxsfs.files._store import FrameStore
from jaxsfs.video._worker import PINS, pin_threads

distributed = pytest.importorskip("distributed", reason="the extra cluster is not installed")
pytest.importorskip("zarr", reason="the extra cluster is not installed")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Forty equal pictures."""
    path = tmp_path_factory.mktemp("frames")
    scene = render_scene(WavyWall(1.4, 0.03, 6.0), width=96, height=96)
    files.write_camera(path / "camera.json", scene.camera_file)
    files.write_png(path / "0.png", scene.photo.stored)
    for index in range(1, 40):
        os.link(path / "0.png", path / f"{index}.png")
    return path


@pytest.fixture
def cluster():
    """A scheduler with two workers, as someone else would have started it, and the workers' processes."""
    import dask.config

    with (
        dask.config.set({"distributed.worker.multiprocessing-method": "spawn"}),
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", memory_limit=0) as cluster,
    ):
        yield cluster


def words(folder: Path, out: Path, *more: str) -> list[str]:
    start = ["video", str(folder), "--camera", str(folder / "camera.json"), "--out", str(out), "--batch", "2"]
    return [*start, *more]


def process() -> tuple[int, str | None]:
    import multiprocessing

    return os.getpid(), multiprocessing.get_start_method(allow_none=True)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_worker_is_killed_and_every_frame_is_there_once(folder, tmp_path, cluster, capfd):
    out = tmp_path / "r.zarr"
    with distributed.Client(cluster) as client:
        before = {pid for pid, _ in client.run(process).values()}
    assert len(before) == 2
    killed = []

    def kill_one():
        while not killed:
            if len(list(out.glob("status/c/*"))) >= 3:
                killed.append(next(iter(before)))
                os.kill(killed[0], signal.SIGKILL)
            threading.Event().wait(0.01)

    thread = threading.Thread(target=kill_one, daemon=True)
    thread.start()
    assert main(words(folder, out, "--scheduler", cluster.scheduler_address, "--quiet")) == 0
    thread.join(timeout=5)
    assert killed, "the run was over before a worker could be killed"
    with distributed.Client(cluster) as client:
        assert killed[0] not in {pid for pid, _ in client.run(process).values()}
    store = FrameStore(out)
    assert store.indices.tolist() == list(range(40))
    assert (store.statuses() == 0).all()
    ranges = np.asarray(store._group["range"][:])
    np.testing.assert_array_equal(ranges, np.broadcast_to(ranges[0], ranges.shape))
    here = tmp_path / "here.zarr"
    assert main(words(folder, here, "--frames", "0:2", "--quiet")) == 0
    np.testing.assert_allclose(ranges[:2], np.asarray(FrameStore(here)._group["range"][:]), rtol=2e-5)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_processes_of_its_own(folder, tmp_path, capsys):
    assert main(words(folder, tmp_path / "r.zarr", "--processes", "1", "--frames", "0:6", "--quiet")) == 0
    assert (FrameStore(tmp_path / "r.zarr").statuses() == 0).all()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_as_many_workers_as_asked_for_of_one_thread_each():
    from jaxsfs.video._cluster import _client

    with _client(None, 1) as client:
        assert list(client.nthreads().values()) == [1]


def test_without_the_extra(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main(words(folder, tmp_path / "r.zarr", "--processes", "2")) == 2
    assert "--processes 2: a cluster needs the extra: pip install 'jaxsfs[cluster]'" in capsys.readouterr().err


def test_no_scheduler_there(folder, tmp_path, capsys, monkeypatch):
    from jaxsfs.video import _cluster

    monkeypatch.setattr(_cluster, "_PATIENCE", 0.3)
    assert main(words(folder, tmp_path / "r.zarr", "--scheduler", "tcp://127.0.0.1:9")) == 2
    assert "--scheduler tcp://127.0.0.1:9" in capsys.readouterr().err


def test_threads_are_set_before_jax_is_imported():
    """In a process of its own: importing the worker's code imports neither JAX nor OpenCV."""
    import subprocess

    code = (
        "import os, sys; from jaxsfs.video._worker import pin_threads; assert 'jax' not in sys.modules; "
        "assert 'cv2' not in sys.modules; pin_threads(); import jax, cv2, jax.numpy as jnp; "
        "x = jnp.ones((600, 600)); (x @ x).block_until_ready(); assert cv2.getNumThreads() == 1; "
        "names = [open(f'/proc/self/task/{t}/comm').read().strip() for t in os.listdir('/proc/self/task')]; "
        "print(sum('XLAEigen' in n for n in names), os.environ['OMP_NUM_THREADS'])"
    )
    free = {name: text for name, text in os.environ.items() if name not in PINS}
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=free, check=True)
    eigen, omp = run.stdout.split()
    assert (int(eigen) <= 1, omp) == (True, "1")


def test_what_the_environment_says_goes_first(monkeypatch):
    import sys

    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    monkeypatch.delitem(sys.modules, "jax")
    monkeypatch.setattr("cv2.setNumThreads", lambda count: None)
    monkeypatch.setenv("XLA_FLAGS", "--xla_force_host_platform_device_count=2")
    for name in PINS.keys() - {"OMP_NUM_THREADS", "XLA_FLAGS"}:
        monkeypatch.setenv(name, os.environ.get(name, ""))
    pin_threads()
    assert os.environ["OMP_NUM_THREADS"] == "3"
    flags = os.environ["XLA_FLAGS"].split()
    assert flags == ["--xla_force_host_platform_device_count=2", "--xla_cpu_multi_thread_eigen=false"]


@pytest.mark.slow
def test_several_devices_share_the_batches(folder, tmp_path):
    """Two of XLA's virtual devices: both are used, and the surfaces are those of one."""
    import subprocess

    code = (
        "import sys, jax; from jaxsfs.cli import main; used = set(); default = jax.default_device\n"
        "def noted(device):\n    used.add(device.id)\n    return default(device)\n"
        "jax.default_device = noted; assert main(sys.argv[1:]) == 0; print(len(used))"
    )
    ranges = []
    for count in (1, 2):
        out = tmp_path / f"{count}.zarr"
        flags = {"XLA_FLAGS": f"--xla_force_host_platform_device_count={count}"}
        line = [sys.executable, "-c", code, *words(folder, out, "--frames", "0:8", "--quiet")]
        used = subprocess.run(line, capture_output=True, text=True, env=os.environ | flags, check=True).stdout
        assert int(used) == (0 if count == 1 else 2)  # one device needs no choice
        ranges.append(np.asarray(FrameStore(out)._group["range"][:]))
    np.testing.assert_allclose(ranges[0], ranges[1], rtol=2e-5)
