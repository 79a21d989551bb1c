"""Programs rewritten from Python: the same as the command does."""

from __future__ import annotations

from pathlib import Path

import pytest

trical = pytest.importorskip("trical")

CELL = Path(__file__).resolve().parents[2] / "cells" / "irb120"
FILES = {"robot": CELL / "robot.toml", "cell": CELL / "cell.toml"}
PROGRAM = b"x_mm,y_mm,z_mm,qw,qx,qy,qz\r\n350,50,320,0,0.6,0.8,0\r\n# gr\xfc\xdfe\n"


def test_the_nominal_arm_changes_no_byte(tmp_path: Path) -> None:
    program, out = tmp_path / "p.csv", tmp_path / "new.csv"
    program.write_bytes(PROGRAM)
    done = trical.compensate(program, trical.Model.nominal(**FILES), out, **FILES)
    assert done["targets"] == 1 and done["problems"] == []
    mark, rest = out.read_bytes().split(b"\n", 1)
    assert b"compensated by TriCal" in mark and rest == PROGRAM


def test_without_an_output_each_target_is_told(tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_bytes(PROGRAM)
    done = trical.compensate(tmp_path / "p.csv", trical.Model.nominal(**FILES), **FILES)
    assert [r["line"] for r in done["rows"]] == [2]
    trical.Model.nominal(**FILES).save(tmp_path / "m.toml")
    assert trical.compensate(tmp_path / "p.csv", tmp_path / "m.toml", **FILES)["rows"] == done["rows"]
    (tmp_path / "m.toml").unlink()
    assert list(tmp_path.iterdir()) == [tmp_path / "p.csv"]


def test_what_is_wrong_is_one_sentence(tmp_path: Path) -> None:
    model = trical.Model.nominal(**FILES)
    (tmp_path / "p.txt").write_bytes(PROGRAM)
    with pytest.raises(trical.TricalError, match="dialect"):
        trical.compensate(tmp_path / "p.txt", model, **FILES)
    (tmp_path / "far.csv").write_bytes(PROGRAM.replace(b"350,", b"3500,"))
    with pytest.raises(trical.TricalError, match="out of reach"):
        trical.compensate(tmp_path / "far.csv", model, tmp_path / "new.csv", **FILES)
    assert not (tmp_path / "new.csv").exists()


def test_what_is_wrong_is_said_in_words_of_python(tmp_path: Path) -> None:
    model = trical.Model.nominal(**FILES)
    (tmp_path / "far.csv").write_bytes(PROGRAM.replace(b"350,", b"3500,"))
    with pytest.raises(trical.TricalError, match=r"nothing was written \(partial=True writes the others\)"):
        trical.compensate(tmp_path / "far.csv", model, tmp_path / "new.csv", **FILES)
    (tmp_path / "p.txt").write_bytes(PROGRAM)
    with pytest.raises(trical.TricalError, match="; dialect says it"):
        trical.compensate(tmp_path / "p.txt", model, **FILES)
    (tmp_path / "p.csv").write_bytes(PROGRAM)
    (tmp_path / "frames.toml").write_text("[tools]\n")
    with pytest.raises(trical.TricalError, match="found no tool and no frame"):
        trical.compensate(tmp_path / "p.csv", model, **FILES, frames=tmp_path / "frames.toml")
    with pytest.raises(trical.TricalError, match="temp_c is 900, expected -100 to 200"):
        trical.compensate(tmp_path / "p.csv", model, **FILES, temp_c=900)
    with pytest.raises(
        trical.TricalError, match=r"session: found 'tuesday', expected a session of the model by its number"
    ):
        trical.compensate(tmp_path / "p.csv", model, **FILES, time_s=60, session="tuesday")
    with pytest.raises(trical.TricalError, match="session: found without time_s or seq"):
        trical.compensate(tmp_path / "p.csv", model, **FILES, session=1)
    # and what is listed and returned
    (tmp_path / "p.mod").write_text(
        "MoveL [[350,50,320],[0,0.6,0.8,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,fine,tGun;\n"
    )
    done = trical.compensate(tmp_path / "p.mod", model, **FILES)
    assert "(frames gives tools and frames)" in done["problems"][0]
