"""Units as tasks of Ray."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from umbel.errors import Error
from umbel.scale.executor import Futures, Result, Task, perform

#: Times that Ray starts a task again whose process or machine is gone.
_RETRIES = 5


class Ray(Futures):
    """Builds units on a Ray cluster, so many at once as it has processors and memory for.

    address: of the cluster, as `ray.init` takes it: "auto" is the one that this machine belongs
        to. Where Ray is connected already, that is used.
    options: more options of each task, such as `{"resources": {"big": 1}}`.
    """

    def __init__(self, address: str = "auto", **options: Any) -> None:
        try:
            self._ray: Any = import_module("ray")
        except ImportError:
            raise Error("building with Ray needs it: pip install 'umbel[ray]'") from None
        super().__init__()
        self._address = address
        self._options = options
        self._connected = False
        self._task: Any = None

    def start(self, unit_bytes: int, threads: int) -> None:
        if not self._ray.is_initialized():
            try:
                self._ray.init(address=self._address, log_to_driver=False, configure_logging=False)
            except Exception as error:
                said = str(error).strip().splitlines() or [type(error).__name__]
                raise Error(f"no Ray cluster at {self._address}: {said[0]}") from None
            self._connected = True
        needs = {"num_cpus": threads, "memory": unit_bytes, "max_retries": _RETRIES}
        self._task = self._ray.remote(**{**needs, **self._options})(perform)
        nodes = [node["Resources"] for node in self._ray.nodes() if node["Alive"]]
        if not any(n.get("CPU", 0) >= threads and n.get("memory", 0) >= unit_bytes for n in nodes):
            raise Error(
                f"no machine of the Ray cluster has {threads} processors and {unit_bytes:,} bytes "
                "of memory for a unit: add one, or make units smaller with unit_triangles"
            )

    def slots(self) -> int:
        # Machines come and go.
        return max(2, 2 * int(self._ray.cluster_resources().get("CPU", 1)))

    def _start(self, task: Task) -> Any:
        return self._task.remote(task)

    def _wait(self, futures: list[Any], seconds: float) -> list[Any]:
        done: list[Any] = self._ray.wait(futures, timeout=seconds)[0]
        return done

    def _result(self, future: Any) -> Result:
        result: Result = self._ray.get(future)
        return result

    def close(self) -> None:
        for future in self._tasks:
            self._ray.cancel(future, force=True)
        self._tasks.clear()
        if self._connected:
            self._ray.shutdown()
            self._connected = False
