"""Sweeps that are killed, interrupted or run twice at once: nothing is lost, repeated or read by halves."""

import re
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
import swept_by_others
from swept_by_others import MESHES, answer, cases

SCRIPT = swept_by_others.__file__
LIMIT = 300.0
#: Of each run its solution, which is the same on every machine, and the time that it took on this one.
FILES = 2 * len(MESHES)


def begin(directory, log, what="whole"):
    command = [sys.executable, SCRIPT, str(directory), str(log), what]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def lines(log):
    return log.read_text().splitlines() if log.exists() else []


def kept(log):
    return [line for line in lines(log) if line.startswith("kept")]


def end_after(process, log, count, how):
    """Send a signal once so many runs are kept in the log."""
    until = time.monotonic() + LIMIT
    while len(set(kept(log))) < count and process.poll() is None and time.monotonic() < until:
        time.sleep(0.002)
    process.send_signal(how)
    return process.communicate(timeout=LIMIT)


@pytest.fixture(scope="module")
def expected():
    """What an undisturbed sweep prints."""
    return "".join(
        f"{case.mesh[0]} {float(answer(case.scene, case.run()).position('beam', 1.0).sum())!r}\n"
        for case in cases()
    )


def assert_nothing_repeated(log, killed):
    """No run is done again once it was kept; each kill costs the run it hit and no other."""
    seen = set()
    for line in lines(log):
        what, mesh = line.split()
        assert what == "kept" or mesh not in seen, f"mesh {mesh} ran again"
        seen |= {mesh} if what == "kept" else set()
    assert seen == {str(n) for n in MESHES}
    ran = Counter(line for line in lines(log) if line.startswith("ran"))
    assert sum(ran.values()) <= len(MESHES) + killed


def files_of(directory):
    return sorted(re.sub("[0-9a-f]{64}", "#", p.name) for p in directory.iterdir())


def test_killed_twice_then_run_again(tmp_path, expected):
    log, runs = tmp_path / "log", tmp_path / "runs"
    for count in (3, 7):
        process = begin(runs, log)
        end_after(process, log, count, signal.SIGKILL)
        assert process.returncode == -signal.SIGKILL
    last = begin(runs, log)
    out, err = last.communicate(timeout=LIMIT)
    assert (out, err, last.returncode) == (expected, "", 0)
    assert_nothing_repeated(log, killed=2)
    assert files_of(runs) == ["#.run"] * FILES


def test_killed_with_half_a_file_written(tmp_path, expected):
    log, runs = tmp_path / "log", tmp_path / "runs"
    for n in (5, 3):  # with the solutions of two runs and their times, and then of one, whole
        process = begin(runs, log, f"die{n}")
        process.communicate(timeout=LIMIT)
        assert process.returncode == -signal.SIGKILL
        assert any(name.startswith(".#.run.") for name in files_of(runs))
    assert len(set(kept(log))) == 3
    last = begin(runs, log)
    assert last.communicate(timeout=LIMIT) == (expected, "")
    assert_nothing_repeated(log, killed=2)
    assert files_of(runs) == ["#.run"] * FILES


def test_two_sweeps_at_once_share_their_runs(tmp_path, expected):
    log, runs = tmp_path / "log", tmp_path / "runs"
    both = [begin(runs, log), begin(runs, log)]
    assert [process.communicate(timeout=LIMIT)[0] for process in both] == [expected] * 2
    ran = [line for line in lines(log) if line.startswith("ran")]
    assert sorted(ran) == sorted(f"ran {n}" for n in MESHES)


@pytest.fixture(params=[signal.default_int_handler, signal.SIG_IGN], ids=["foreground", "background"])
def shell(request):
    """How the shell that started the tests has them take SIGINT: children inherit that it is ignored."""
    before = signal.signal(signal.SIGINT, request.param)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("shell")
def test_interrupted_sweep_keeps_its_runs_and_says_how_to_go_on(tmp_path, expected):
    log = tmp_path / "log"
    process = begin(tmp_path, log, "interruptible")
    _, err = end_after(process, log, 3, signal.SIGINT)
    said = " ".join(err.split())
    assert process.returncode == 130, err
    done = re.search(
        r"Interrupted\. Finished runs \((\d+) of this session\) are stored in (\S+); continue with: anctmm",
        said,
    )
    assert done, said
    assert Path(done[2]) == tmp_path / "anctmm" / "runs"
    assert 3 <= int(done[1]) < len(MESHES)
    assert "Traceback" not in err
    again = begin(tmp_path, log, "interruptible")
    assert again.communicate(timeout=LIMIT)[0] == expected
    assert_nothing_repeated(log, killed=1)
