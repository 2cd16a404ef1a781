"""Units as tasks of Dask."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from umbel.errors import Error
from umbel.scale.executor import Futures, Result, Task, perform

_RETRIES = 5


class Dask(Futures):
    """Builds units on a Dask cluster, so many at once as its workers have threads and memory for.

    client: a `distributed.Client`, or the address of a scheduler.
    """

    def __init__(self, client: Any) -> None:
        try:
            self._distributed: Any = import_module("distributed")
        except ImportError:
            raise Error("building with Dask needs it: pip install 'umbel[dask]'") from None
        super().__init__()
        self._address = client if isinstance(client, str) else None
        self._client: Any = client if self._address is None else None
        self.connect()
        self._unit_bytes = 1
        self._threads = 1

    def connect(self) -> None:
        if self._client is not None:
            return
        try:
            self._client = self._distributed.Client(self._address, set_as_default=False)
        except Exception as error:
            raise Error(f"no Dask scheduler at {self._address}: {error}") from None

    def start(self, unit_bytes: int, threads: int) -> None:
        self.connect()
        self._unit_bytes, self._threads = unit_bytes, threads
        if self._fitting() == 0:
            raise Error(
                f"no worker of the Dask cluster has {unit_bytes:,} bytes of memory for a unit: add "
                "one, or make units smaller with unit_triangles"
            )

    def _fitting(self) -> int:
        """Units that fit into the workers side by side. Dask itself knows no memory of tasks."""
        count = 0
        for worker in self._client.scheduler_info(n_workers=-1)["workers"].values():
            limit = worker["memory_limit"] or 1 << 62
            count += min(max(1, worker["nthreads"] // self._threads), limit // self._unit_bytes)
        return count

    def slots(self) -> int:
        return max(1, self._fitting())

    def _start(self, task: Task) -> Any:
        # Not pure: a task that is tried again is not the one that was lost.
        return self._client.submit(perform, task, pure=False, retries=_RETRIES)

    def _wait(self, futures: list[Any], seconds: float) -> list[Any]:
        try:
            with self._client.as_current():
                waited = self._distributed.wait(
                    futures, timeout=max(seconds, 1e-3), return_when="FIRST_COMPLETED"
                )
        except TimeoutError:
            return []
        return list(waited.done)

    def _result(self, future: Any) -> Result:
        result: Result = future.result()
        return result

    def close(self) -> None:
        for future in self._tasks:
            future.cancel()
        self._tasks.clear()
        if self._address is not None and self._client is not None:
            self._client.close()
            self._client = None
