"""What the command line does when something goes wrong: one sentence, the right exit status, and
no file of the output's name that is not whole."""

from __future__ import annotations

import errno
import io
import os
import random
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import umbel
from helpers.commands import COMMAND, Outcome, Umbel
from umbel.cli import progress


def assert_one_sentence(done: Outcome, status: int = 1) -> None:
    assert done.status == status, done.err
    if done.out:  # with --json
        assert set(done.json) == {"error", "input"} and done.out.count("\n") == 1
        assert done.err == f"umbel: {done.json['error']}\n"
    assert len(done.err.strip().splitlines()) == 1 and done.err.startswith("umbel: ")
    assert "Traceback" not in done.err


@pytest.fixture(scope="module")
def large_ply(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("large") / "large.ply"
    umbel.save(path, umbel.shapes.blob(7))
    return path


def test_faults_of_the_input_are_one_sentence(
    umbel_command: Umbel, blob_ply: Path, blob_asset: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out.umbel"
    garbage = tmp_path / "garbage.ply"
    garbage.write_bytes(os.urandom(5000))
    half = tmp_path / "half.ply"
    half.write_bytes(blob_ply.read_bytes()[:100_000])
    for arguments in (
        ["build", tmp_path / "missing.ply", "-o", out],
        ["build", garbage, "-o", out],
        ["build", half, "-o", out],
        ["build", tmp_path, "-o", out],
        ["build", blob_ply, "-o", tmp_path / "no" / "folder.umbel"],
        ["build", blob_ply, "-o", tmp_path / "out.txt"],
        ["build", blob_ply, "-o", out, "--max-triangles", 1],
        ["build", blob_ply, "-o", out, "--max-vertices", 1000],
        ["build", blob_ply, "-o", out, "--max-vertices", -1],
        ["build", blob_ply, "-o", out, "--group-size", "many"],
        ["build", blob_ply, "-o", out, "--group-size", "9:3"],
        ["build", blob_asset, "-o", out],
        ["info", tmp_path / "missing.umbel"],
        ["info", tmp_path / "missing.glb"],
        ["info", garbage],
        ["verify", tmp_path / "missing.umbel"],
        ["extract", blob_ply, "--level", 0, "-o", tmp_path / "x.ply"],
        ["extract", blob_asset, "--level", 0, "-o", tmp_path / "x.stl"],
        ["extract", blob_asset, "--level", -1, "-o", tmp_path / "x.ply"],
        ["extract", blob_asset, "--error", "nan", "-o", tmp_path / "x.ply"],
        ["cluster", garbage],
        ["cluster", blob_ply, "--max-triangles", 0],
        ["cluster", blob_ply, "--min-triangles", 500],
        ["cluster", blob_ply, "--underfill", 7],
        ["cluster", blob_ply, "-o", tmp_path / "x.txt"],
    ):
        done = umbel_command(*arguments, "--json")
        assert_one_sentence(done)
        assert done.json["input"] == str(arguments[1])
        assert any(str(word) in done.err for word in arguments[1:] if isinstance(word, Path))
    assert sorted(os.listdir(tmp_path)) == ["garbage.ply", "half.ply"]


def test_usage_is_status_two(umbel_command: Umbel, blob_ply: Path, blob_asset: Path) -> None:
    for arguments in (
        ["fly"],
        ["build"],
        ["build", blob_ply],
        ["build", blob_ply, "-o", "x.umbel", "--threads", "-1"],
        ["build", blob_ply, "-o", "x.umbel", "--threads", "two"],
        ["build", blob_ply, "-o", "x.umbel", "--attributes", "some"],
        ["build", blob_ply, "-o", "x.umbel", "--no-such-flag"],
        ["extract", blob_asset, "-o", "x.ply"],
        ["extract", blob_asset, "--level", "0", "--error", "1", "-o", "x.ply"],
        ["cluster", blob_ply, "--method", "magic"],
    ):
        done = umbel_command(*arguments)
        assert done.status == 2 and done.out == "" and done.err
        assert "Traceback" not in done.err
        done = umbel_command(*arguments, "--json")
        assert_one_sentence(done, status=2)
        assert done.json["input"] == (str(arguments[1]) if len(arguments) > 1 else None)


def _small_files() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))


def test_a_full_disk_is_one_sentence(
    umbel_command: Umbel, blob_ply: Path, blob_asset: Path, tmp_path: Path
) -> None:
    for arguments in (
        ["build", blob_ply, "-o", tmp_path / "out.umbel"],
        ["extract", blob_asset, "--level", "0", "-o", tmp_path / "out.glb"],
        ["extract", blob_asset, "--level", "0", "-o", tmp_path / "out.ply"],
        ["extract", blob_asset, "--level", "0", "-o", tmp_path / "out.obj"],
        ["cluster", blob_ply, "-o", tmp_path / "out.npz"],
        ["cluster", blob_ply, "-o", tmp_path / "out.glb"],
    ):
        done = umbel_command(*arguments, preexec_fn=_small_files)
        assert_one_sentence(done)
        assert os.listdir(tmp_path) == []


def test_a_really_full_disk_is_one_sentence(
    umbel_command: Umbel, blob_ply: Path, tmp_path: Path
) -> None:
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(tmp_path)]
    try:
        mounted = subprocess.run(mount, capture_output=True, check=False).returncode == 0
    except OSError:
        mounted = False
    if not mounted:
        pytest.skip("mounting a small file system is not allowed here")
    try:
        done = umbel_command("build", blob_ply, "-o", tmp_path / "out.umbel")
        assert_one_sentence(done)
        assert "space" in done.err
        assert os.listdir(tmp_path) == []
    finally:
        subprocess.run(["umount", str(tmp_path)], check=True)


def test_a_folder_that_cannot_be_written_is_one_sentence(
    umbel_command: Umbel, blob_ply: Path
) -> None:
    done = umbel_command("build", blob_ply, "-o", "/proc/out.umbel")
    assert_one_sentence(done)


def test_a_failed_build_leaves_the_old_file(
    umbel_command: Umbel, blob_ply: Path, tmp_path: Path
) -> None:
    output = tmp_path / "out.umbel"
    output.write_bytes(b"the old one")
    done = umbel_command("build", blob_ply, "-o", output, preexec_fn=_small_files)
    assert_one_sentence(done)
    assert output.read_bytes() == b"the old one" and os.listdir(tmp_path) == ["out.umbel"]


def _default_signals() -> None:
    # `nohup` and shells' background jobs ignore some, which children inherit.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def _started(source: Path, output: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*COMMAND, "build", str(source), "-o", str(output)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=_default_signals,
    )


def test_killing_a_build_leaves_no_half_file(large_ply: Path, tmp_path: Path) -> None:
    whole = tmp_path / "whole.umbel"
    began = time.perf_counter()
    assert _started(large_ply, whole).wait() == 0
    duration = time.perf_counter() - began
    expected = whole.read_bytes()
    rng = random.Random(time.time_ns())
    parts = [rng.uniform(0.0, 1.1) for _ in range(12)]
    # The end, where the file is written, gets its own share.
    parts += [rng.uniform(0.85, 1.05) for _ in range(12)]
    killed = 0
    for part in parts:
        output = tmp_path / "killed.umbel"
        process = _started(large_ply, output)
        moment = part * duration
        time.sleep(moment)
        process.kill()
        process.communicate()
        killed += process.returncode == -signal.SIGKILL
        if process.returncode == 0 and part < 1:
            duration *= 0.9  # the machine was busier before
        if output.exists():
            assert output.read_bytes() == expected, f"half a file when killed after {moment:.3f} s"
            output.unlink()
    # How many are caught depends on how busy the machine is from one run to the next.
    assert killed >= 3


@pytest.mark.parametrize(
    ("number", "word"),
    [
        (signal.SIGINT, "interrupted"),
        (signal.SIGTERM, "terminated"),
        (signal.SIGHUP, "terminated"),
    ],
)
def test_signals_end_a_build_cleanly(
    large_ply: Path, tmp_path: Path, number: signal.Signals, word: str
) -> None:
    output = tmp_path / "out.umbel"
    began = time.perf_counter()
    assert _started(large_ply, output).wait() == 0
    duration = time.perf_counter() - began
    expected = output.read_bytes()
    output.unlink()
    stopped = 0
    for part in (0.4, 0.5, 0.6, 0.7, 0.8) * 6:
        if stopped == 5:
            break
        process = _started(large_ply, output)
        time.sleep(part * duration)
        process.send_signal(number)
        out, err = process.communicate(timeout=30)
        # It was faster than the time before, or slower and Python itself had not started yet.
        if process.returncode in (0, -number) or out:
            duration *= 1.1 if process.returncode == -number else 0.9
            output.unlink(missing_ok=True)
            continue
        stopped += 1
        assert process.returncode == 128 + number, err
        assert err == f"umbel: {word}\n"
        # A signal that comes once the file is written, before that is said, leaves it whole.
        if output.exists():
            assert output.read_bytes() == expected
            output.unlink()
        assert os.listdir(tmp_path) == []
    assert stopped > 0


def test_a_bar_on_a_terminal_that_is_gone_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        is_gone = False

        def isatty(self) -> bool:
            return True

        def write(self, text: str) -> int:
            if self.is_gone:
                raise OSError(errno.EIO, "Input/output error")
            return super().write(text)

    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    with progress.Bar() as bar:
        bar(0.5, "half")
        assert terminal.getvalue()
        terminal.is_gone = True
        bar.say("something")


def test_nobody_reading_the_output_is_no_crash(blob_asset: Path) -> None:
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        [*COMMAND, "info", str(blob_asset)],
        stdout=write,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    os.close(write)
    assert done.returncode == 1 and "Traceback" not in done.stderr


def test_output_that_is_closed_is_one_sentence(blob_asset: Path, tmp_path: Path) -> None:
    for arguments in (
        ["info", str(blob_asset)],
        ["info", str(blob_asset), "--json"],
        ["--version"],
        ["extract", str(blob_asset), "-o", str(tmp_path / "coarse.ply"), "--level", "1"],
    ):
        done = subprocess.run(
            ["/bin/sh", "-c", '"$@" >&-', "sh", *COMMAND, *arguments],
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
        assert done.returncode == 1 and "Traceback" not in done.stderr
        assert done.stderr.endswith("cannot write standard output: Bad file descriptor\n")
    assert (tmp_path / "coarse.ply").stat().st_size > 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has /dev/full")
@pytest.mark.parametrize("buffered", [True, False])
def test_output_that_cannot_be_written_is_one_sentence(blob_asset: Path, buffered: bool) -> None:
    environment = {**os.environ, "PYTHONUNBUFFERED": "" if buffered else "1"}
    reader, closed = os.pipe()
    os.close(reader)
    cannot = "cannot write standard output: No space left on device"
    for arguments, status, sentence in (
        (["info", str(blob_asset), "--json"], 1, f"{blob_asset}: {cannot}"),
        (["--version"], 1, cannot),
        (["info", "--bogus", "--json"], 2, "No such option: --bogus"),
        (["info", "no.ply", "--json"], 1, "cannot read no.ply: No such file or directory"),
    ):
        for output in (os.open("/dev/full", os.O_WRONLY), closed):
            done = subprocess.run(
                [*COMMAND, *arguments],
                stdout=output,
                stderr=subprocess.PIPE,
                text=True,
                check=False,
                env=environment,
            )
            quiet = output == closed and cannot in sentence
            assert done.stderr == ("" if quiet else f"umbel: {sentence}\n")
            assert done.returncode == status


@pytest.mark.parametrize("suffix", ["ply", "obj", "glb"])
def test_names_that_are_no_text_are_no_crash(
    umbel_command: Umbel, tmp_path: Path, suffix: str
) -> None:
    plain = tmp_path / f"plain.{suffix}"
    umbel.save(plain, umbel.shapes.blob(3))
    source = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9." + suffix.encode()))
    plain.rename(source)
    asset = source.with_suffix(".umbel")
    assert umbel_command("build", source, "-o", asset, "--json").status == 0
    assert umbel_command("build", tmp_path, "-o", tmp_path / "out", "--json").status == 0
    assert os.listdir(os.fsencode(tmp_path / "out")) == [b"caf\xe9.umbel"]
    assert umbel_command("info", asset, "--json").json["source"]["file"] == f"caf?.{suffix}"
    assert umbel_command("info", asset).status == 0
    assert umbel_command("verify", asset, "--json").json["ok"] is True
    assert_one_sentence(umbel_command("info", source.with_name("\udce9.ply")))


def test_output_that_has_not_all_letters_is_no_crash(
    umbel_command: Umbel, blob_asset: Path, tmp_path: Path
) -> None:
    asset = tmp_path / "\u0107.umbel"
    asset.write_bytes(blob_asset.read_bytes())
    done = umbel_command("info", asset, env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert done.status == 0 and "\\u0107.umbel" in done.out and done.err == ""


def test_sigterm_while_starting_shows_no_traceback(blob_asset: Path) -> None:
    for moment in (0.05, 0.1, 0.15, 0.2, 0.3):
        process = subprocess.Popen(
            [*COMMAND, "info", str(blob_asset)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        time.sleep(moment)
        process.send_signal(signal.SIGTERM)
        _, err = process.communicate(timeout=60)
        assert "Traceback" not in err
        assert process.returncode in (0, 128 + signal.SIGTERM, -signal.SIGTERM)


def test_a_signal_while_a_class_is_made_is_one_sentence() -> None:
    program = """
import os, signal, sys, types
import umbel.cli

class Descriptor:
    def __set_name__(self, owner, name):
        os.kill(os.getpid(), signal.SIGTERM)

def app(prog_name):
    type("Made", (), {"member": Descriptor()})

sys.modules["umbel.cli.app"] = types.SimpleNamespace(app=app)
umbel.cli.main()
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert_one_sentence(Outcome(done.returncode, done.stdout, done.stderr), status=143)


def test_a_signal_while_a_module_is_imported_is_no_missing_package() -> None:
    program = """
import os, signal, sys, types
import umbel, umbel.cli
from umbel.cli.run import ends_cleanly

@ends_cleanly()
def command():
    try:
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except BaseException as stopped:  # as extension modules do
            raise ImportError("initialization failed") from stopped
    except ImportError:
        raise umbel.Error("a package is missing") from None

def app(prog_name):
    import typer
    typer.run(command)

sys.modules["umbel.cli.app"] = types.SimpleNamespace(app=app)
sys.argv = ["umbel"]
umbel.cli.main()
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (130, "umbel: interrupted\n")
