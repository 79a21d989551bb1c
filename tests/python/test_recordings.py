"""`trical.Recording`: from files, from arrays, as arrays, through pickle, pandas and back."""

from __future__ import annotations

import builtins
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import trical
from conftest import program

ROOT = Path(__file__).resolve().parents[2]
ARM = ROOT / "cells" / "irb120"
FILES = {"robot": ARM / "robot.toml", "cell": ARM / "cell.toml"}

EVERYTHING = """\
t_s,seq,q1_deg,q2_deg,qc1_deg,qc2_deg,dir1,dir2,ball,ix_mm,iy_mm,iz_mm,target,reference,x_mm,y_mm,z_mm,qw,qx,qy,qz,d_mm,anchor,temp_c,payload_kg
0,0,10,-20,10.01,-20.01,1,-1,2,0.01,-0.02,0.03,,,,,,,,,,,,21.5,0
1,0,10,-20,,,,,,,,,2,,100,200,300,,,,,,,21.5,
2,1,15,-25,15,-25,0,1,,,,,,3,110,210,310,,,,,,,,2.5
3,1,15,-25,15,-25,0,1,,,,,,,120,220,320,1,0,0,0,,,22,2.5
4,2,15,-30,15,-30,0,1,,,,,,,,,,,,,,450,2,22,2.5
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "everything.csv"
    path.write_text(EVERYTHING)
    return path


@pytest.fixture
def recording(path: Path) -> trical.Recording:
    return trical.Recording.load(path)


def columns(r: trical.Recording) -> dict[str, np.ndarray]:
    names = ["q", "commanded", "directions", "time", "temperature", "payload", "pose", "ball", "indicators", "target"]
    names += ["reference", "position", "orientation", "anchor", "distance"]
    return {k: v for k in names if (v := getattr(r, k)) is not None}


def test_columns_are_arrays_in_si(recording: trical.Recording) -> None:
    r = recording
    assert (len(r), r.joints, r.name.endswith("everything.csv")) == (5, 2, True)
    assert r.kind.tolist() == ["touch", "point", "reference", "pose", "distance"]
    np.testing.assert_allclose(r.q[0], np.radians([10, -20]))
    np.testing.assert_allclose(r.commanded[0], np.radians([10.01, -20.01]))
    assert np.isnan(r.commanded[1]).all() and np.isnan(r.directions[1]).all()
    assert r.directions[0].tolist() == [1, -1]
    np.testing.assert_allclose(r.indicators[0], [1e-5, -2e-5, 3e-5])
    assert (r.ball.tolist(), r.target.tolist()) == ([2, 0, 0, 0, 0], [0, 2, 0, 0, 0])
    assert (r.reference.tolist(), r.anchor.tolist()) == ([0, 0, 3, 0, 0], [0, 0, 0, 0, 2])
    np.testing.assert_allclose(r.position[1], [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(r.orientation[3], [1, 0, 0, 0])
    assert r.distance[4] == pytest.approx(0.45)
    assert r.time.tolist() == [0, 1, 2, 3, 4] and r.pose.tolist() == [0, 0, 1, 1, 2]
    assert r.payload[4] == 2.5 and np.isnan(r.temperature[2])
    assert r.line.tolist() == [2, 3, 4, 5, 6]


def test_columns_are_made_once_and_cannot_be_written(recording: trical.Recording) -> None:
    assert recording.q is recording.q
    with pytest.raises(ValueError, match="read-only"):
        recording.q[0] = 0


def test_what_no_row_has_is_none() -> None:
    r = trical.Recording(q=[[0, 0]], distance=0.4)
    assert r.ball is None and r.time is None and r.directions is None and r.anchor.tolist() == [1]
    assert trical.Recording(q=[[0, 0]], position=[0, 0, 1], directions=[1, 0]).directions.dtype == np.int8


def test_arrays_make_the_same_recording(recording: trical.Recording, tmp_path: Path) -> None:
    again = trical.Recording(**columns(recording), name=recording.name)
    assert again == recording
    again.save(tmp_path / "again.csv")
    assert trical.Recording.load(tmp_path / "again.csv").to_csv() == recording.to_csv()
    assert recording[1:] != again


def test_it_pickles_to_the_last_bit(recording: trical.Recording) -> None:
    again = pickle.loads(pickle.dumps(recording))
    assert (again, again.name, again.line.tolist()) == (recording, recording.name, recording.line.tolist())
    for name, column in columns(recording).items():
        np.testing.assert_array_equal(getattr(again, name), column)


def test_mcap_and_back(recording: trical.Recording, tmp_path: Path) -> None:
    recording.save(tmp_path / "r.mcap")
    again = trical.Recording.load(tmp_path / "r.mcap")
    assert again.kind.tolist() == recording.kind.tolist()
    np.testing.assert_allclose(again.q, recording.q, atol=1e-12)
    whole = (tmp_path / "r.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(trical.RecordingError, match=r"cut\.mcap.*no complete measurement|part=True"):
        trical.Recording.load(tmp_path / "cut.mcap")


def test_rows_are_chosen_as_in_numpy(recording: trical.Recording) -> None:
    assert recording[1:3].kind.tolist() == ["point", "reference"]
    assert recording[recording.temperature > 21.9].line.tolist() == [5, 6]
    assert recording[[3, 0]].line.tolist() == [2, 5]
    assert len(recording[-1]) == 1
    for none in (recording.ball == 9, []):
        with pytest.raises(trical.TricalError, match="no row was chosen of 5"):
            recording[none]
    with pytest.raises(TypeError, match="rows: found 'q', expected a slice, a mask"):
        recording["q"]


def test_pandas_has_the_columns_of_the_csv(recording: trical.Recording) -> None:
    pytest.importorskip("pandas", reason="pandas is not installed")
    frame = recording.to_pandas()
    assert frame.shape[0] == 5 and frame["q1_deg"].tolist() == [10, 10, 15, 15, 15]
    assert frame["ix_mm"][0] == pytest.approx(0.01)


def test_names_of_places_and_fixed_points_come_back(tmp_path: Path) -> None:
    pytest.importorskip("pandas", reason="pandas is not installed")
    r = trical.Recording(q=np.zeros((3, 2)), position=[0, 0, 1], place=["#1", "01", "nan"])
    assert r.place is not None and r.place.tolist() == ["#1", "01", ""]
    frame = r.to_pandas()
    assert frame["place"].tolist() == ["#1", "01", ""]
    r.save(tmp_path / "r.csv")
    for back in (trical.Recording.load(tmp_path / "r.csv"), trical.Recording.from_frame(frame)):
        assert back.place is not None and back.place.tolist() == ["#1", "01", ""]
    # a fixed point has no orientation
    fixed = trical.Recording(q=np.zeros((1, 2)), position=[0, 0, 1], orientation=[1, 0, 0, 0], reference=2)
    assert fixed.kind.tolist() == ["reference"] and fixed.reference is not None and fixed.reference.tolist() == [2]


def test_without_pandas_the_error_says_what_to_install(
    recording: trical.Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = builtins.__import__

    def none(name: str, *args: object, **more: object) -> object:
        if name.split(".")[0] in ("pandas", "matplotlib"):
            raise ImportError(name)
        return real(name, *args, **more)

    monkeypatch.setattr(builtins, "__import__", none)
    with pytest.raises(ImportError, match="pip install pandas"):
        recording.to_pandas()


def test_it_says_what_it_holds(recording: trical.Recording) -> None:
    assert "1 touch" in repr(recording) and "2 joints" in repr(recording)
    html = recording._repr_html_()
    assert "<table>" in html and "reference" in html and "temperature" in html


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"q": [0, 0]}, r"q has the shape \[2\], expected \(n, joints\)"),
        ({"q": np.zeros((2, 12))}, "with 1 to 9 joints"),
        ({}, "found no measurement"),
        ({"ball": 1}, "row 0: touches ball 1, but has no indicators"),
        ({"ball": [1.5, 1], "indicators": [0, 0, 0]}, "ball, row 0: found 1.5, expected a number counted from 1"),
        ({"ball": 1, "indicators": [0, 0, 0], "distance": 1}, "row 0: found several measurements"),
        ({"position": np.zeros((3, 3))}, r"position has the shape \[3, 3\], expected \[2, 3\]"),
        ({"position": [[0, 0, 1], [0, np.nan, 1]]}, "position, row 1: found NaN, expected a number between"),
        ({"position": [0, 0, 1], "time": [2, 1]}, "time, row 1: found 1 after 2"),
        ({"distance": 1, "time": 1.7e9}, "seconds since the recording began; subtract the first time"),
        ({"position": [0, 0, 1], "orientation": [1, 1, 0, 0]}, "the quaternion has length 1.4142, expected 1"),
        ({"position": [0, 0, 1], "directions": [2, 0]}, "directions, row 0: found 2, expected -1, 0 or 1"),
        ({"position": [0, 0, 1], "target": 1, "reference": 1}, "names a target and a reference"),
        ({"position": [0, 0, 1], "orientation": [1, 0, 0, 0], "target": 2}, "found target 2 with an orientation"),
        ({"position": [0, 0, 1e6]}, "position, row 0: found 1000000"),
        ({"distance": [1, -1]}, "distance, row 1: found -1, expected a positive length"),
        ({"q": [[0, 0], [0, 1e9]], "distance": 1}, "q, row 1: found 1000000000"),
    ],
)
def test_what_makes_no_sense_is_refused(given: dict, said: str) -> None:
    with pytest.raises(trical.RecordingError, match=said):
        trical.Recording(**{"q": np.zeros((2, 2)), **given})


def test_files_recordings_and_formats_mix(tmp_path: Path) -> None:
    truth = trical.Model.nominal(**FILES)
    seen = trical.simulate(truth, trical.poses(40, **FILES), target=1, seed=1)
    more = trical.simulate(truth, trical.poses(40, **FILES, seed=2), target=1, seed=2)
    seen.save(tmp_path / "a.csv")
    seen.save(tmp_path / "a.mcap")
    by_object = trical.identify([seen, more], **FILES)
    for path in ("a.csv", "a.mcap"):
        by_path = trical.identify([tmp_path / path, more], **FILES)
        assert by_path.errors == pytest.approx(by_object.errors, rel=1e-6)
    assert by_object.observations == 80


def test_files_in_passes_give_what_files_at_once_give(tmp_path: Path) -> None:
    trical.simulate(trical.Model.nominal(**FILES), trical.poses(80, **FILES), target=1).save(tmp_path / "r.csv")
    at_once = trical.identify(tmp_path / "r.csv", **FILES)
    in_passes = trical.identify(tmp_path / "r.csv", **FILES, stream=True)
    assert in_passes.errors == pytest.approx(at_once.errors, rel=1e-3) and in_passes.observations == 80
    assert in_passes.errors_mm is None
    trical.convert(tmp_path / "r.csv", tmp_path / "r.mcap")
    by_mcap = trical.identify(tmp_path / "r.mcap", **FILES, stream=True)
    assert by_mcap.errors_mm is None and by_mcap.errors == pytest.approx(in_passes.errors, rel=1e-6)
    (tmp_path / "cut.mcap").write_bytes((tmp_path / "r.mcap").read_bytes()[:-400])
    with pytest.raises(trical.RecordingError, match=r"trical\.convert saves what is whole"):
        trical.identify(tmp_path / "cut.mcap", **FILES, stream=True)
    with pytest.raises(trical.TricalError, match="stream goes without folds"):
        trical.identify(tmp_path / "r.csv", **FILES, stream=True, folds=4)


def test_the_command_line_reads_what_is_written_here(tmp_path: Path) -> None:
    trical.simulate(trical.Model.nominal(**FILES), trical.poses(40, **FILES), target=1).save(tmp_path / "r.mcap")
    command = [program(), "identify", "r.mcap", "--robot", FILES["robot"], "--cell", FILES["cell"]]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "40 measurements" in done.stdout


def test_a_worker_that_knows_only_the_module_can_unpickle(recording: trical.Recording, tmp_path: Path) -> None:
    (tmp_path / "r.pickle").write_bytes(pickle.dumps(recording))
    code = "import pickle, sys; print(len(pickle.load(open(sys.argv[1], 'rb'))))"
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "r.pickle"], capture_output=True, text=True)
    assert done.stdout.strip() == "5", done.stderr


def test_a_frame_is_taken_as_it_is(recording: trical.Recording) -> None:
    pytest.importorskip("pandas", reason="pandas is not installed")
    frame = recording.to_pandas()
    again = trical.Recording.from_frame(frame)
    for name in ("q", "ball", "indicators", "directions", "time"):
        np.testing.assert_array_equal(getattr(again, name), getattr(recording, name), err_msg=name)
    assert again.name == "DataFrame"
    with pytest.raises(trical.RecordingError, match=r"^DataFrame, header: unknown column 'colour'"):
        trical.Recording.from_frame(frame.assign(colour="red"))


def test_what_is_no_recording_is_said_in_one_sentence(tmp_path: Path) -> None:
    made = trical.sample(tmp_path)
    where = {"robot": made.robot, "cell": made.cell}
    for wrong in (3, None, [3], {1: 2}):
        with pytest.raises(TypeError, match=r"found \w+, expected paths, Recordings or DataFrames"):
            trical.identify(wrong, **where)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"robot: found NoneType, expected the path of a file, or a Robot"):
        trical.identify(made.recording, robot=None, cell=made.cell)  # type: ignore[arg-type]
    path = str(made.recording).encode()
    robot = str(made.robot).encode()
    assert trical.identify(path, robot=robot, cell=made.cell).observations > 0  # type: ignore[arg-type]
    copy = str(tmp_path / "copy").encode()
    for kind, file in ((trical.Robot, robot), (trical.Cell, str(made.cell).encode())):
        kind.load(file).save(copy)
        assert kind.load(copy).to_toml() == kind.load(file).to_toml()


def test_frames_keep_an_index_that_is_a_column_and_lack_what_is_missing(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.read_csv(trical.sample(tmp_path).recording)
    whole = trical.Recording.from_frame(frame)
    assert trical.Recording.from_frame(frame.set_index("t_s")) == whole
    assert trical.Recording.from_frame(frame.set_index(frame.index + 100)) == whole
    assert trical.Recording.from_frame(frame.set_index(["t_s", "ball"])) == whole
    twice = pandas.concat([frame, frame[["ball"]]], axis=1)
    with pytest.raises(trical.RecordingError, match="DataFrame, header: column ball is given twice"):
        trical.Recording.from_frame(twice)
    lost = frame.astype({"ix_mm": "Float64"})
    lost.loc[4, "ix_mm"] = pandas.NA
    with pytest.warns(UserWarning, match="line 6 lacks a measured value and is left out"):
        assert len(trical.Recording.from_frame(lost)) == len(whole) - 1
    with pytest.raises(trical.RecordingError, match="line 6, column q1_deg"):
        trical.Recording.from_frame(frame.assign(q1_deg=frame.q1_deg.where(frame.index != 4)))


def test_rows_without_a_measured_value_are_left_out_with_a_warning(tmp_path: Path) -> None:
    made = trical.sample(tmp_path)
    head, *rows = made.recording.read_text().splitlines()
    at = head.split(",").index("ix_mm")
    cells = rows[3].split(",")
    rows[3] = ",".join([*cells[:at], "NaN", *cells[at + 1 :]])
    made.recording.write_text("\n".join([head, *rows, ""]))
    with pytest.warns(UserWarning, match="line 5 lacks a measured value and is left out"):
        assert len(trical.Recording.load(made.recording)) == len(rows) - 1
    with pytest.warns(UserWarning, match="line 5 lacks"):
        trical.identify(made.recording, robot=made.robot, cell=made.cell, model="geometry")
    passes = trical.identify(made.recording, robot=made.robot, cell=made.cell, model="geometry", stream=True)
    assert any("line 5 lacks a measured value" in caution for caution in passes.cautions)


def test_a_lazy_frame_is_to_be_collected_first() -> None:
    class Lazy:
        columns = ("q1_deg",)

        def collect_schema(self) -> None: ...

        def collect(self) -> None: ...

    with pytest.raises(TypeError, match=r"LazyFrame.*collect\(\) first"):
        trical.Recording.from_frame(Lazy())  # type: ignore[arg-type]


def test_columns_of_different_lengths_are_refused_by_their_names() -> None:
    class Uneven:
        columns = ("q1_deg", "x_mm", "y_mm", "z_mm")

        def __getitem__(self, name: str) -> list[float]:
            return [1.0] * (2 if name == "z_mm" else 3)

    with pytest.raises(trical.RecordingError, match=r"^DataFrame: column y_mm has 3 rows, z_mm has 2$"):
        trical.Recording.from_frame(Uneven())  # type: ignore[arg-type]
