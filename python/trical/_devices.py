"""Gauges and controllers by their URLs, and a cell without hardware: what `gauge`, `robot` and `virtual-cell` do."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import TYPE_CHECKING, Any

from . import _html, _native
from ._calls import _machine, _robot, _three
from ._native import Cell, ControllerLink, GaugeLink, Model, Robot, TricalError, VirtualCell
from ._recording import PathLike

if TYPE_CHECKING:  # whoever imports trical need not wait for NumPy
    import numpy as np
    import numpy.typing as npt
    from typing_extensions import Self

    Floats = npt.NDArray[np.float64]

AXES = ("x", "y", "z")


def gauges() -> list[dict[str, str | None]]:
    """List the serial ports of this computer: dicts with port, device and url, None where it looks like no gauge.

    The url is a suggestion for `Gauge` and `measure`; check which channel is which axis.
    """
    return [{"port": port, "device": device, "url": url} for port, device, url in _native._ports()]


@dataclass(frozen=True, repr=False)
class GaugeTest:
    """How a gauge answered: `readings` (n, 3) m, as fast as they came.

    `name` is the gauge, `says` what the device says of itself, one line each, `seconds_each` the time for a reading of
    all three axes. `axes` are dicts with axis, mean, sd, spread (from the least to the largest) and step (the smallest
    difference between two different readings, or None), m. `warnings` are the device's.
    """

    name: str
    says: list[str]
    readings: Floats
    seconds_each: float
    axes: list[dict[str, Any]]
    warnings: list[str] = field(default_factory=list)

    def _rows(self) -> list[list[object]]:
        def mm(x: float | None) -> object:
            return "-" if x is None else 1e3 * x

        return [[a["axis"], *(mm(a[k]) for k in ("mean", "sd", "spread", "step"))] for a in self.axes]

    def _head(self) -> str:
        return f"{self.name}: {len(self.readings)} readings of all three axes, {1e3 * self.seconds_each:.0f} ms each"

    def __repr__(self) -> str:
        """What the device says of itself, and how steady it was."""
        lines = [f"<trical.GaugeTest of {self._head()}>", *(f"  {line}" for line in self.says)]
        lines.append("axis   mean mm     sd mm  spread mm  smallest step mm")
        for axis, *numbers in self._rows():
            said = [f"{x:10.4f}" if isinstance(x, float) else f"{x!s:>10}" for x in numbers]
            lines.append(f"{axis}   {said[0]}{said[1]}{said[2]:>11}{said[3]:>16}")
        return "\n".join([*lines, *(f"note: {w}" for w in self.warnings)])

    def _repr_html_(self) -> str:
        head = ("axis", "mean, mm", "sd, mm", "from least to largest, mm", "finest step, mm")
        return _html.table(head, self._rows(), self._head()) + "".join(map(_html.note, [*self.says, *self.warnings]))


class _Device:
    """A device at a URL, open until `close` or the end of a `with` block."""

    url: str
    _link: GaugeLink | ControllerLink

    @property
    def name(self) -> str:
        """What it is and where."""
        return self._link.name

    @property
    def closed(self) -> bool:
        """Whether it was closed."""
        return self._link.closed

    def close(self) -> None:
        """Close the connection; calling it again does nothing."""
        self._link.close()

    def __enter__(self) -> Self:
        """Return it."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""
        self.close()


class Gauge(_Device):
    """A gauge by its URL, open until `close` or the end of a `with` block.

    Readings are the ball's centre relative to the TCP, in the device's axes, m. A port has one reader: close the gauge
    before `measure` opens it.

    Args:
        url: as for `trical measure --gauge`: "uwave:///dev/ttyUSB0?x=00&y=01&z=02" (Mitutoyo U-WAVE-R), "itn://"
            (Mitutoyo USB-ITN) or one of the others that `trical gauge test --help` lists, with a port, or with three,
            commas between.

    Raises:
        TricalError: a URL that cannot be used.
        DeviceError: the port cannot be opened; below, no answer, or none that makes sense.
    """

    _link: GaugeLink

    def __init__(self, url: str) -> None:
        """See the class."""
        self.url = url
        self._link = GaugeLink.open(url)

    def read(self) -> Floats:
        """Return one reading as it comes, (3,), m."""
        return self._link.read(False)

    def settled(self) -> Floats:
        """Return the reading once it stands still, (3,), m: the mean of the last ones, which agree."""
        return self._link.read(True)

    def watch(self, count: int | None = None, every: float = 0.2) -> Iterator[tuple[float, Floats]]:
        """Yield (seconds since the first, reading (3,) m), so many times or for ever, with a pause of `every` s."""
        begin, n = time.monotonic(), 0
        while count is None or n < count:
            if n:
                time.sleep(every)
            reading = self.read()
            yield time.monotonic() - begin, reading
            n += 1

    def warnings(self) -> list[str]:
        """Return the warnings of the device since the last call, such as a low battery: one sentence each."""
        return self._link.warnings()

    def test(self, count: int = 20) -> GaugeTest:
        """Read `count` times, 2 or more, and say what the device is, how fast it answers and how still it stands."""
        if not 2 <= count <= 10_000:
            raise TricalError(f"count is {count}, expected 2 to 10000")
        says, readings, seconds_each, axes = self._link.trial(count)
        told = [
            {"axis": axis, "mean": mean, "sd": sd, "spread": spread, "step": step}
            for axis, (mean, sd, spread, step) in zip(AXES, axes, strict=True)
        ]
        return GaugeTest(self.name, says, readings, seconds_each, told, self.warnings())

    def wait_for_stem(self, axis: str, timeout: float = 60.0) -> float:
        """Wait until a person pushes the stem along `axis` ("x", "y" or "z"), and return by how much it moved, m.

        Raises DeviceError where another axis moves, by more than 0.5 mm, or none does within `timeout` s.
        """
        if axis not in AXES:
            raise TricalError(f"axis is {axis!r}, expected 'x', 'y' or 'z'")
        return self._link.stem(AXES.index(axis), timeout)

    def __repr__(self) -> str:
        """Name, and whether it is open."""
        return f"<trical.Gauge {self.name}{': closed' if self.closed else ''}>"


def master(url: str) -> str:
    """Master a gauge whose three stems are on the calibrator; return its URL to use from now on.

    The steady reading there is subtracted from every later reading (`zero_mm` in the URL). An earlier mastering in
    `url` is ignored. Errors as for `Gauge`.
    """
    _, mastered, _ = _native._master(url)
    return mastered


class Controller(_Device):
    """A robot controller by its URL, open until `close` or the end of a `with` block.

    Args:
        url: as for `trical measure --controller`: "rapid://192.168.125.1:5000?secret=WORD" (ABB,
            rapid/TriCal.mod), "rws://HOST?user=NAME&password=WORD" (ABB, Robot Web Services), "ur://HOST" (Universal
            Robots). "@FILE" for a secret is the first line of a file.

    Raises:
        TricalError: a URL that cannot be used.
        DeviceError: no connection; below, no answer, or a motion that is refused.
    """

    _link: ControllerLink

    def __init__(self, url: str) -> None:
        """See the class."""
        self.url = url
        self._link = ControllerLink.open(url)

    @property
    def dof(self) -> int:
        """Number of the arm's joints, as the controller says."""
        return self._link.dof

    def ping(self) -> dict[str, float | None]:
        """Ask whether the controller answers: answers_in (s, median of five), clock (s), temperature (degC, or None).

        Nothing moves.
        """
        answers_in, clock, temperature = self._link.ping()
        return {"answers_in": answers_in, "clock": clock, "temperature": temperature}

    def joints(self) -> Floats:
        """Return where the joints are, once they stand still: (joints,), rad (m). Nothing moves."""
        return self._link.joints()

    def jog(
        self,
        *,
        joint: int | None = None,
        by: float | None = None,
        to: npt.ArrayLike | None = None,
        tool: Sequence[float] | None = None,
        max_angle: float = 0.08726646259971647,
        speed: float = 0.01,
        robot: PathLike | Robot | None = None,
        go: bool = False,
    ) -> Floats:
        """Move a little, with `go=True` only; return where the joints are then, or would be, (joints,), rad (m).

        Args:
            joint: which joint, from 1, goes on `by` so many rad (m).
            by: see `joint`.
            to: instead, (joints,): where all joints go, rad (m).
            tool: instead, (3,): how far the tool goes along its own axes, m, each 5 mm at most; the joints that would
                be reached are not known beforehand.
            max_angle: no joint goes farther than this, rad; 5 degrees.
            speed: of the tool, m/s, 0.25 at most.
            robot: the arm, whose limits are kept.
            go: move.

        Raises:
            TricalError: a motion that is not small, or beyond the limits; nothing has moved.
            DeviceError: the controller refuses or does not answer.
        """
        if (joint is None) != (by is None):
            raise TricalError("expected joint and by together: which joint goes on by how much")
        one = None if joint is None or by is None else (joint, float(by))
        goal = None
        if to is not None:
            import numpy as np

            goal = [float(x) for x in np.asarray(to, dtype=np.float64).ravel()]
        given: dict[str, Any] = {"joint": one, "to": goal, "max_angle": max_angle, "speed": speed, "go": go}
        given["tool"] = None if tool is None else _three(tool, "tool")
        given["robot"] = None if robot is None else _robot(robot)
        _, after = self._link.jog(given)
        return after

    def __repr__(self) -> str:
        """Name, number of joints, and whether it is open."""
        return f"<trical.Controller {self.name}: {self.dof} joints{', closed' if self.closed else ''}>"


def virtual_cell(
    *,
    robot: PathLike | Robot,
    cell: PathLike | Cell,
    truth: Model | None = None,
    seed: int = 1,
    hide: str | Sequence[str] = (),
    port: int = 0,
    gauge_port: int | None = None,
    faults: PathLike | None = None,
    pace: float = 0.0,
    radio_delay: float = 0.0,
    unsettled: Sequence[float] | None = None,
    noise: float = 5e-7,
    placement: float = 4e-6,
    start: npt.ArrayLike | None = None,
) -> VirtualCell:
    """Start a robot, balls and indicators that answer on a pseudo-terminal and a TCP port, to measure without hardware.

    >>> with trical.virtual_cell(robot="robot.toml", cell="cell.toml") as cell:  # doctest: +SKIP
    ...     trical.measure(plan, "run.mcap", robot=..., cell=..., gauge=cell.gauge, controller=cell.controller, go=True)

    Args:
        robot: path of a robot.toml or URDF, or a Robot: the arm with which the controller computes.
        cell: path of a cell.toml, or a Cell.
        truth: the true arm; random if not given: errors of 0.3 mm and 0.1 deg in the chain, more in base and tool,
            compliances of 0.002 to 0.02 deg/Nm. `VirtualCell.truth` has it.
        seed: of the true arm and of all noise.
        hide: effects (see `effects`) to hide in the arm, with site and size in typical ones:
            "lost_motion_direction@3*2", "gear_ripple@4/100" (cycles), "joint_zero_shift@2/600" (s).
        port: of the controller; 0 is any that is free.
        gauge_port: TCP port of the indicators' receiver; 0 is any that is free. Without it the receiver answers on a
            pseudo-terminal, on Windows on any free TCP port.
        faults: a TOML file of what goes wrong, and when.
        pace: real seconds for each second of motion; 0 is at once.
        radio_delay: how long the receiver repeats the last value after a motion, s.
        unsettled: (3,) joints that are read too early, short by so many rad, indicators off by so many m, both decaying
            with a time constant in s.
        noise: standard deviation of each indicator, m.
        placement: standard deviation, on each axis, of where the arm comes to rest, m.
        start: (joints,) where the arm stands at first, rad (m); all zero where not given.

    Raises:
        TricalError: bad input; an effect that is not known.
        DeviceError: the port is in use.
    """
    for name, value in {"port": port, "gauge_port": gauge_port or 0}.items():
        if not 0 <= value <= 65535:
            raise TricalError(f"{name} is {value}, expected 0 to 65535")
    given: dict[str, Any] = {"truth": truth, "seed": seed, "port": port, "faults": faults, "start": start}
    given["gauge_port"] = gauge_port
    given["hide"] = [hide] if isinstance(hide, str) else list(hide)
    given["unsettled"] = None if unsettled is None else _three(unsettled, "unsettled")
    given |= {"pace": pace, "radio_delay": radio_delay, "noise": noise, "placement": placement}
    return _native._virtual_cell(_machine(robot, cell), given)
