"""Processes that build files side by side. One that dies takes no other with it."""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import signal
import subprocess
from collections.abc import Iterable, Iterator
from typing import IO, Any

from umbel.scale.worker import python_command

COMMAND = python_command("from umbel.cli.building.worker import main; main()")
_PATIENCE = 10.0  # seconds for a process to remove its unfinished file


class Worker:
    """A process, and the job that it is at."""

    def __init__(self) -> None:
        self.job: dict[str, Any] | None = None
        self._received = b""
        # A session of its own: Ctrl-C is for the process at the terminal, which ends the others.
        self._process = subprocess.Popen(
            COMMAND,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
        )

    @property
    def answers(self) -> IO[bytes]:
        """Where the answers come from."""
        assert self._process.stdout is not None
        return self._process.stdout

    def give(self, job: dict[str, Any]) -> None:
        """Starts a job. If the process is gone, the next `answer` says so."""
        assert self._process.stdin is not None
        self.job = job
        with contextlib.suppress(OSError):
            self._process.stdin.write(json.dumps(job).encode() + b"\n")
            self._process.stdin.flush()

    def answer(self) -> dict[str, Any] | None:
        """The answer to the job, once all of it is there."""
        block = os.read(self.answers.fileno(), 1 << 20)
        if not block:
            return {"status": "failed", "error": f"{(self.job or {})['input']}: {self._end()}"}
        self._received += block
        line, newline, rest = self._received.partition(b"\n")
        if not newline:
            return None
        self._received = rest
        answer: dict[str, Any] = json.loads(line)
        return answer

    @property
    def is_dead(self) -> bool:
        """Whether the process has ended."""
        return self._process.poll() is not None

    def stop(self) -> None:
        """Has the process end, without the file that it is at."""
        if not self.is_dead:
            self._process.terminate()

    def join(self) -> None:
        """Waits until the process has ended."""
        try:
            self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()

    def _end(self) -> str:
        status = self._process.wait()
        if status >= 0:
            return f"the process that built it ended with status {status}"
        name = signal.Signals(-status).name if -status in set(signal.Signals) else str(-status)
        cause = ", perhaps for want of memory" if -status == signal.SIGKILL else ""
        return f"the process that built it was ended by {name}{cause}"


def work_off(
    jobs: Iterable[dict[str, Any]], count: int
) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Gives jobs to at most `count` processes, and yields each job with its answer when that is
    there. Whoever stops before the end has all processes stopped."""
    waiting = iter(jobs)
    workers: list[Worker] = []
    with selectors.DefaultSelector() as selector:
        try:
            while True:
                while len(workers) < count:
                    job = next(waiting, None)
                    if job is None:
                        break
                    worker = Worker()
                    workers.append(worker)
                    selector.register(worker.answers, selectors.EVENT_READ, worker)
                    worker.give(job)
                if not workers:
                    return
                for key, _ in selector.select():
                    worker = key.data
                    answer = worker.answer()
                    if answer is None:
                        continue
                    assert worker.job is not None
                    yield worker.job, answer
                    job = None if worker.is_dead else next(waiting, None)
                    if job is not None:
                        worker.give(job)
                        continue
                    selector.unregister(worker.answers)
                    workers.remove(worker)
                    worker.stop()
                    worker.join()
        finally:
            for worker in workers:
                worker.stop()
            for worker in workers:
                worker.join()
