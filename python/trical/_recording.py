"""Recordings as NumPy arrays."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

from . import _html
from ._given import path_of, whole
from ._native import RecordingError, Rows, TricalError

if TYPE_CHECKING:  # whoever imports trical need not wait for NumPy
    import numpy as np
    import numpy.typing as npt
    import pandas

    Floats = npt.NDArray[np.float64]
    Integers = npt.NDArray[np.int64]

PathLike = str | os.PathLike[str]

_KINDS = ("touch", "point", "reference", "distance", "pose")
_KNOWN = ("commanded", "directions", "torques", "time", "temperature", "payload", "pose", "place")
_INDEXED = ("t_s", "seq", "place", "ball", "target")
_MEASURED = ("ball", "indicators", "target", "reference", "position", "orientation", "anchor", "distance")


class Frame(Protocol):
    """A DataFrame: pandas, polars, or whatever has columns and gives them by name."""

    @property
    def columns(self) -> Iterable[Any]:
        """Names of the columns."""

    def __getitem__(self, name: Any, /) -> Any:
        """Return a column."""


class Recording:
    """Measurements of one arm in one session: n rows, in the order of time.

    Arrays have one row for each measurement; a number (or a single row) stands for all of them. SI throughout: rad (m
    for prismatic joints), m, s, kg; temperature in degC. Balls, targets, references and anchors count from 1, as in
    files; rows without the value have 0 there, and nan in other columns.

    Args:
        q: joint values that the controller reported, (n, joints).
        commanded: joint values that were commanded, (n, joints).
        directions: sense of each joint's last motion before the reading, (n, joints): -1, 0 or 1.
        torques: measured joint torques, (n, joints), N m (N for prismatic joints).
        time: (n,), s since the recording began, never falling.
        temperature: (n,), degC.
        payload: (n,), kg on the flange beyond the cell's tool.
        pose: (n,), number of the pose, where a pose has several rows.
        place: (n,), names or numbers: where the set of balls stood; "" where not known.
        ball: (n,), the ball that was touched; with `indicators`.
        indicators: (n, 3), m: the ball's centre relative to the TCP, in the device's axes.
        target: (n,), which target of the tool the tracker saw at `position`; 1 where not given.
        reference: (n,), which fixed point of the cell was seen at `position`.
        position: (n, 3), m, in the measuring frame.
        orientation: (n, 4), unit quaternion w, x, y, z, measuring frame from tool: with `position`, a full pose.
        anchor: (n,), where `distance` was measured from; 1 where not given.
        distance: (n,), m, from the anchor to the TCP.
        prismatic: which joints slide, (joints,): files have them in mm.
        name: for messages.

    >>> r = Recording(q=[[0.0, 0.1], [0.2, 0.1]], position=[[0.4, 0, 0.3], [0.4, 0.1, 0.3]])
    >>> len(r), r.joints, list(r.kind)
    (2, 2, ['point', 'point'])
    """

    _rows: Rows

    def __init__(
        self,
        *,
        q: npt.ArrayLike,
        commanded: npt.ArrayLike | None = None,
        directions: npt.ArrayLike | None = None,
        torques: npt.ArrayLike | None = None,
        time: npt.ArrayLike | None = None,
        temperature: npt.ArrayLike | None = None,
        payload: npt.ArrayLike | None = None,
        pose: npt.ArrayLike | None = None,
        place: npt.ArrayLike | None = None,
        ball: npt.ArrayLike | None = None,
        indicators: npt.ArrayLike | None = None,
        target: npt.ArrayLike | None = None,
        reference: npt.ArrayLike | None = None,
        position: npt.ArrayLike | None = None,
        orientation: npt.ArrayLike | None = None,
        anchor: npt.ArrayLike | None = None,
        distance: npt.ArrayLike | None = None,
        prismatic: Sequence[bool] | None = None,
        name: str = "recording",
    ) -> None:
        """See the class."""
        given = locals()
        columns = {k: given[k] for k in ("q", *_KNOWN, *_MEASURED, "prismatic") if given[k] is not None}
        if place is not None:
            import numpy as np

            names = np.asarray(place).astype(str)
            columns["place"] = (
                np.broadcast_to(names, (len(np.atleast_2d(q)),)).tolist() if names.ndim == 0 else names.tolist()
            )
        self._rows = Rows.build(name, columns)

    @classmethod
    def _of(cls, rows: Rows) -> Recording:
        made = cls.__new__(cls)
        made._rows = rows
        return made

    @classmethod
    def _restore(cls, name: str, columns: dict[str, Any]) -> Recording:
        return cls._of(Rows.build(name, columns))

    @classmethod
    def load(cls, path: PathLike, *, joints: int | None = None, part: bool = False) -> Recording:
        """Read a CSV or an MCAP.

        `joints` is the number of the arm's joints, by default as many as the file has. A damaged MCAP is refused unless
        `part` is true: then its complete measurements are taken.
        """
        return cls._of(Rows.load(path_of(path), whole("joints", joints), part))

    @classmethod
    def from_frame(cls, frame: Frame, *, name: str = "DataFrame") -> Recording:
        """Read a DataFrame (pandas, polars, or whatever has `columns` and columns by name) with the columns of the CSV.

        Names, units and meaning are those of docs/formats.md: mm and degrees; what is missing in a row is NaN or None.
        `identify`, `diagnose` and `validate` accept such a frame directly. Raises RecordingError.
        """
        import numpy as np

        if hasattr(frame, "collect_schema") and hasattr(frame, "collect"):
            raise TypeError(f"{name}: found a LazyFrame, expected a DataFrame: call collect() first")
        index: Any = getattr(frame, "index", None)
        # set_index("t_s") takes a column away
        taken = [n for n in getattr(index, "names", ()) if n in _INDEXED and n not in frame.columns]
        if taken:
            frame = frame.reset_index(taken)  # type: ignore[attr-defined]
        names = [str(c) for c in frame.columns]
        twice = next((n for k, n in enumerate(names) if n in names[:k]), None)
        if twice is not None:
            raise RecordingError(f"{name}, header: column {twice} is given twice")

        def cell(x: Any) -> str:
            # neither NaN nor pandas.NA is equal to itself
            missing = x is None or type(x).__name__ == "NAType" or x != x
            return "" if missing else str(x)

        def column(values: Any) -> npt.NDArray[np.float64] | list[str]:
            plain = np.asarray(values)
            if plain.dtype.kind == "f":
                return plain.astype(np.float64)
            return [cell(x) for x in np.asarray(values, dtype=object).tolist()]

        columns = [(str(c), column(frame[c])) for c in frame.columns]
        if columns and columns[0][0].lower() == "place":  # a line that begins with "#1" is a remark
            columns.append(columns.pop(0))
        return cls._of(Rows.table(name, columns))

    def save(self, path: PathLike) -> None:
        """Write a .csv or an .mcap, by the ending of the name."""
        self._rows.save(os.fspath(path))

    def to_csv(self, path: PathLike | None = None) -> str | None:
        """Write the recording as CSV (mm and degrees, as names of columns say), or return its text without a path."""
        text = self._rows.to_csv()
        if path is None:
            return text.decode()
        with open(path, "wb") as f:
            f.write(text)
        return None

    def to_pandas(self) -> pandas.DataFrame:
        """Return a DataFrame with the columns of the CSV: mm and degrees, one row a measurement."""
        try:
            import pandas
        except ImportError:
            raise ImportError("to_pandas needs pandas, which is not installed: pip install pandas") from None
        import io

        # names stay text: "01" is no number, "NA" no gap
        table = pandas.read_csv(
            io.BytesIO(self._rows.to_csv()), dtype={"place": str}, keep_default_na=False, na_values=[""]
        )
        return table if "place" not in table else table.assign(place=table["place"].fillna(""))

    def _column(self, name: str) -> Any:
        found = self._rows.column(name)
        if found is not None:
            found.flags.writeable = False  # a view of what was measured, not a place to change it
        return found

    @property
    def name(self) -> str:
        """Where it came from, for messages."""
        return self._rows.name

    @property
    def joints(self) -> int:
        """Number of the arm's joints."""
        return self._rows.joints

    @cached_property
    def q(self) -> Floats:
        """Joint values that the controller reported, (n, joints), rad (m for prismatic joints)."""
        q: Floats = self._column("q")
        return q

    @cached_property
    def kind(self) -> npt.NDArray[np.str_]:
        """What each row is, (n,): "touch", "point", "reference", "distance" or "pose"."""
        import numpy as np

        kind: npt.NDArray[np.str_] = np.array(_KINDS)[self._rows.column("kind")]
        return kind

    @cached_property
    def line(self) -> Integers:
        """Line of each row in its file, (n,); the header is line 1."""
        line: Integers = self._column("line")
        return line

    @cached_property
    def commanded(self) -> Floats | None:
        """Joint values that were commanded, (n, joints), rad (m); None where no row has them."""
        return self._column("commanded")  # type: ignore[no-any-return]

    @cached_property
    def directions(self) -> npt.NDArray[np.int8] | Floats | None:
        """Sense of each joint's last motion, (n, joints): -1, 0 or 1 (floats with nan if some rows lack it)."""
        return self._column("directions")  # type: ignore[no-any-return]

    @cached_property
    def torques(self) -> Floats | None:
        """Measured joint torques, (n, joints), N m (N for prismatic joints); None where no row has them."""
        return self._column("torques")  # type: ignore[no-any-return]

    @cached_property
    def place(self) -> npt.NDArray[np.str_] | None:
        """Where the set of balls stood, (n,): names, "" where a row has none; None where no row has one."""
        names = self._rows.column("place")
        if names is None:
            return None
        import numpy as np

        place: npt.NDArray[np.str_] = np.array(names)
        place.flags.writeable = False
        return place

    @cached_property
    def time(self) -> Floats | None:
        """Time since the recording began, (n,), s."""
        return self._column("time")  # type: ignore[no-any-return]

    @cached_property
    def temperature(self) -> Floats | None:
        """Temperature, (n,), degC."""
        return self._column("temperature")  # type: ignore[no-any-return]

    @cached_property
    def payload(self) -> Floats | None:
        """Mass on the flange beyond the cell's tool, (n,), kg."""
        return self._column("payload")  # type: ignore[no-any-return]

    @cached_property
    def pose(self) -> Floats | None:
        """Number of the pose in the original order, (n,)."""
        return self._column("pose")  # type: ignore[no-any-return]

    @cached_property
    def ball(self) -> Integers | None:
        """Ball that was touched, (n,), from 1; 0 in rows that touch none."""
        return self._column("ball")  # type: ignore[no-any-return]

    @cached_property
    def indicators(self) -> Floats | None:
        """The three indicators, (n, 3), m: the ball's centre relative to the TCP, in the device's axes."""
        return self._column("indicators")  # type: ignore[no-any-return]

    @cached_property
    def target(self) -> Integers | None:
        """Target of the tool that was seen, (n,), from 1; 0 in other rows."""
        return self._column("target")  # type: ignore[no-any-return]

    @cached_property
    def reference(self) -> Integers | None:
        """Fixed point of the cell that was seen, (n,), from 1; 0 in other rows."""
        return self._column("reference")  # type: ignore[no-any-return]

    @cached_property
    def position(self) -> Floats | None:
        """Measured position of target, reference or tool in the measuring frame, (n, 3), m."""
        return self._column("position")  # type: ignore[no-any-return]

    @cached_property
    def orientation(self) -> Floats | None:
        """Measured orientation, (n, 4): unit quaternion w, x, y, z, measuring frame from tool."""
        return self._column("orientation")  # type: ignore[no-any-return]

    @cached_property
    def anchor(self) -> Integers | None:
        """Anchor from which a length was measured, (n,), from 1; 0 in other rows."""
        return self._column("anchor")  # type: ignore[no-any-return]

    @cached_property
    def distance(self) -> Floats | None:
        """Length from the anchor to the TCP, (n,), m."""
        return self._column("distance")  # type: ignore[no-any-return]

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self._rows)

    def __getitem__(self, rows: slice | npt.ArrayLike) -> Recording:
        """Return the rows of a slice, a mask (n,) or an array of numbers, in the order of time."""
        import numpy as np

        n = len(self)
        if isinstance(rows, int | np.integer):
            rows = [int(rows)]
        which = rows if isinstance(rows, slice) else np.asarray(rows)
        if not isinstance(which, slice) and which.size > 0 and which.dtype.kind not in "iub":
            raise TypeError(f"rows: found {rows!r:.60}, expected a slice, a mask or an array of whole numbers")
        chosen = np.arange(n)[which if isinstance(which, slice) or which.size > 0 else []]
        if len(chosen) == 0:
            raise TricalError(f"{self.name}: no row was chosen of {n}")
        return Recording._of(self._rows.take([int(k) for k in np.sort(chosen)]))

    def __add__(self, other: Recording) -> Recording:
        """Join the rows of two recordings of one session: see `concat`."""
        return concat([self, other]) if isinstance(other, Recording) else NotImplemented

    def __eq__(self, other: object) -> bool:
        """Say whether all values are the same."""
        if not isinstance(other, Recording):
            return NotImplemented
        return self.name == other.name and self._rows.to_csv() == other._rows.to_csv()

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, tuple[str, dict[str, Any]]]:
        """Pickle as arrays."""
        names = ("q", *_KNOWN, *_MEASURED, "line", "prismatic")
        columns = {k: c for k in names if (c := self._rows.column(k)) is not None}
        return Recording._restore, (self.name, columns)

    def _counts(self) -> list[tuple[str, int]]:
        import numpy as np

        kinds, counts = np.unique(self.kind, return_counts=True)
        return list(zip(kinds.tolist(), counts.tolist(), strict=True))

    def __repr__(self) -> str:
        """Name, and how many rows of which kind."""
        rows = ", ".join(
            f"{n} {kind}{'' if n == 1 else 's' if kind != 'touch' else 'es'}" for kind, n in self._counts()
        )
        return f"<trical.Recording {self.name}: {rows}; {self.joints} joints>"

    def _repr_html_(self) -> str:
        known = [k for k in _KNOWN if self._rows.column(k) is not None]
        rows: list[Sequence[object]] = [(kind, n) for kind, n in self._counts()]
        table = _html.table(["rows", "n"], rows, f"{self.name}: {self.joints} joints")
        return table + _html.note(f"with {', '.join(known)}" if known else "")


def concat(recordings: Iterable[Recording], *, name: str | None = None) -> Recording:
    """Join recordings of one arm into one: rows of one session that are in several files.

    They share measuring frame, tool and cell; recordings of different days are given to `identify` one by one instead,
    as sessions. What a recording does not have is missing in its rows. If times (or numbers of poses) do not continue,
    those of the later recording are moved to begin where the earlier ends. `name` is by default that of the first.
    Raises RecordingError, TricalError.
    """
    import numpy as np

    parts = list(recordings)
    for part in parts:
        if not isinstance(part, Recording):
            raise TypeError(
                f"recordings: found {type(part).__name__}, expected Recordings (Recording.load reads a file)"
            )
    if not parts:
        raise TricalError("found no recording, expected one or more")
    joints = {p.joints for p in parts}
    if len(joints) > 1:
        raise TricalError(f"found recordings of arms with {sorted(joints)} joints, expected one arm")
    tables = [p.__reduce__()[1][1] for p in parts]
    columns: dict[str, Any] = {}
    for key in dict.fromkeys(k for t in tables for k in t):
        like = next(t[key] for t in tables if key in t)
        if key == "prismatic":
            if any(list(t[key]) != list(like) for t in tables if key in t):
                raise TricalError("found recordings of different arms: not the same joints slide; expected one arm")
            columns[key] = like
        elif key in ("time", "pose"):
            columns[key] = _going_on(
                [t.get(key) for t in tables], [len(p) for p in parts], 1.0 if key == "pose" else 0.0
            )
        elif key == "place":
            columns[key] = [x for t, p in zip(tables, parts, strict=True) for x in t.get(key, [""] * len(p))]
        else:
            like = np.asarray(like)
            empty = 0 if like.dtype.kind in "iu" else np.nan
            blocks = [
                np.asarray(t[key]) if key in t else np.full((len(p), *like.shape[1:]), empty, like.dtype)
                for t, p in zip(tables, parts, strict=True)
            ]
            columns[key] = np.concatenate(blocks)
    return Recording._restore(parts[0].name if name is None else name, columns)


def _going_on(values: list[Any], lengths: list[int], gap: float) -> Floats:
    """Join columns that rise: each is moved to begin behind the end of those before, if it would begin earlier."""
    import numpy as np

    joined: list[Floats] = []
    end = -np.inf
    for column, n in zip(values, lengths, strict=True):
        block = np.full(n, np.nan) if column is None else np.array(column, dtype=float)
        known = block[np.isfinite(block)]
        if len(known) and known.min() < end + gap:
            block = block + (end + gap - known.min())
        if len(known):
            end = max(end, float(np.nanmax(block)))
        joined.append(block)
    return np.concatenate(joined)
