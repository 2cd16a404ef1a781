"""Units as tasks of Ray."""

from __future__ import annotations

import socket
from importlib import import_module
from typing import Any

from umbel.errors import Error
from umbel.scale.executor import Futures, Result, Task, perform

#: Times that Ray starts a task again whose process or machine is gone.
_RETRIES = 5
_SAID = {"CPU": "processors", "memory": "bytes of memory"}


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

    def connect(self) -> None:
        if not self._ray.is_initialized():
            self._check_address()
            try:
                self._ray.init(address=self._address, log_to_driver=False, configure_logging=False)
            except Exception as error:
                said = str(error).strip().splitlines() or [type(error).__name__]
                raise Error(f"no Ray cluster at {self._address}: {said[0]}") from None
            self._connected = True
        self._prepare(0, 1)

    def start(self, unit_bytes: int, threads: int) -> None:
        self._prepare(unit_bytes, threads)

    def _check_address(self) -> None:
        """Ray tries for minutes to reach a machine that is not there."""
        host, _, port = self._address.rpartition("://")[2].rpartition(":")
        if not (host and port.isdigit()):
            return
        try:
            socket.create_connection((host.strip("[]"), int(port)), timeout=10).close()
        except (OSError, OverflowError) as error:
            said = getattr(error, "strerror", None) or error
            raise Error(f"no Ray cluster at {self._address}: {said}") from None

    def _prepare(self, unit_bytes: int, threads: int) -> None:
        """Makes the task, which some machine must have all resources for: Ray waits for one."""
        needs: dict[str, Any] = {"num_cpus": threads, "memory": unit_bytes}
        needs |= {"max_retries": _RETRIES, **self._options}
        try:
            self._task = self._ray.remote(**needs)(perform)
        except (TypeError, ValueError) as error:
            raise Error(f"options of Ray's tasks: {error}") from None
        wanted = {"CPU": needs["num_cpus"] or 0, "memory": needs["memory"] or 0}
        wanted |= {"GPU": needs.get("num_gpus") or 0, **(needs.get("resources") or {})}
        nodes = [node["Resources"] for node in self._ray.nodes() if node["Alive"]]
        if not any(all(n.get(name, 0) >= wanted[name] for name in wanted) for n in nodes):
            said = ", ".join(
                f"{count:,} {_SAID.get(name, name)}" for name, count in wanted.items() if count
            )
            smaller = ", or make units smaller with unit_triangles" if unit_bytes else ""
            raise Error(f"no machine of the Ray cluster has {said} for a unit: add one{smaller}")

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
