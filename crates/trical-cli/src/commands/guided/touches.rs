//! The touches that say where the tool point is, and where the arm stands.

use trical_device::session::{SetUpError, base, tool_point, turned};
use trical_device::{Progress, Session};
use trical_model::pose::rotation_vector;
use trical_model::{Measured, Row};
use trical_recording::RecordingWriter;
use trical_report::table;

use super::ask::{Answer, tell};
use super::checkpoint::beside;
use super::{BALLS, FREE, Led, Next, ORIENTATIONS, Step};
use crate::commands::gauge::shown;
use crate::error::{CliError, Result};

/// Touches for the tool point are asked to be turned by so much from each other, deg.
const TURNED_DEG: f64 = 20.0;

/// A base that is turned by more than this from that of the cell file comes from balls in another order, or the file is no guess, deg.
const BASE_TURNED_DEG: f64 = 15.0;

/// What touches say of the tool point or the world frame; nothing where they do not agree, which is told.
fn fitted<T>(what: &str, found: std::result::Result<T, SetUpError>) -> Result<Option<T>> {
    match found {
        Ok(fit) => Ok(Some(fit)),
        Err(e @ SetUpError::Model(_)) => Err(CliError::input(e)),
        Err(e) => {
            tell(&format!("No {what}: {} Repeat the touches that are wrong.", table::ended(&e.to_string())))?;
            Ok(None)
        }
    }
}

impl Led<'_> {
    /// The recording of the touches for tool point and world frame, with what it has already.
    pub(super) fn open(&mut self) -> Result<RecordingWriter> {
        if let Some(log) = self.log.take() {
            return Ok(log);
        }
        let path = beside(self.about.out, "setup.mcap");
        let header = self.session(&self.about.cell, &[], &path, FREE).header();
        let (log, before) = RecordingWriter::resume(&path, &header)?;
        let since = self.checkpoint.since;
        let rows = before.into_iter().flat_map(|before| before.recording.rows);
        for row in rows.filter(|row| row.state.t.is_none_or(|t| t >= since)) {
            // a touch that was repeated: the last one counts
            row.seq.map(|seq| self.rows.insert(seq, row));
        }
        Ok(log)
    }

    pub(super) fn close(&mut self) -> Result<()> {
        self.log.take().map_or(Ok(()), |log| log.finish().map_err(CliError::failed))
    }

    /// Asks for a touch until it is there. Skipping keeps one that is there, or goes to `skipped`.
    fn touch(&mut self, ball: usize, index: u64, what: &str, skipped: (&str, usize)) -> Result<Next> {
        self.log = Some(self.open()?);
        loop {
            let there = self.rows.contains_key(&index);
            let skip = if there { "touched already; s: keep that touch" } else { skipped.0 };
            match self.ask(&format!("{what}. ({skip}.)"))? {
                Answer::Back => return Ok(Next::Back),
                Answer::Skip if there => return Ok(Next::On),
                Answer::Skip => return Ok(Next::To(skipped.1)),
                _ => {}
            }
            let mut log = self.open()?;
            tell("The arm closes in on the ball.")?;
            let gauge = self.gauge();
            let mut corrected = 0;
            let mut note = |p| match p {
                Progress::Warning(w) => crate::note!("trical: note: {w}"),
                Progress::Measured { corrections, .. } => corrected = corrections,
                _ => {}
            };
            let session = Session { gauge: &gauge, ..self.session(&self.cell, &[], self.about.out, FREE) };
            let touched = session.touch_here(&mut log, ball, index, &mut note);
            self.log = Some(log);
            match touched {
                Ok(row) => {
                    let left = match row.measured {
                        Measured::Touch { reading, .. } => shown(&reading),
                        _ => String::new(),
                    };
                    let corrections = table::counted(corrected, "correction");
                    tell(&format!("Touched and recorded, after {corrections}; the reading left is {left}."))?;
                    self.rows.insert(index, row);
                    if !self.alike(index)? {
                        return Ok(Next::On);
                    }
                }
                Err(e) => tell(&format!("That did not work: {} Try again.", table::ended(&e.to_string())))?,
            }
        }
    }

    /// Whether a touch for the tool point is hardly turned from another one, which is told.
    fn alike(&self, index: u64) -> Result<bool> {
        let Some(row) = self.rows.get(&index).filter(|_| index < ORIENTATIONS as u64) else { return Ok(false) };
        for (other, before) in self.rows.range(..ORIENTATIONS as u64).filter(|(other, _)| **other != index) {
            let by = turned(self.about.robot, &self.cell, row, before).map_err(CliError::failed)?.to_degrees();
            if by < TURNED_DEG {
                tell(&format!(
                    "It is turned by {by:.1} degrees only from orientation {}: turn the device further and touch again.",
                    other + 1
                ))?;
                return Ok(true);
            }
        }
        Ok(false)
    }

    pub(super) fn orientation(&mut self, k: usize) -> Result<Next> {
        if k == 0 {
            tell(
                "2. Tool point. Ball 1 is touched in four orientations that differ by 20 degrees or more, about two axes at \
                 least: bring the device over the ball by hand until all three stems touch, near the middle of their stroke.",
            )?;
        }
        let what = format!("Ball 1, orientation {} of {ORIENTATIONS}", k + 1);
        let next = self.touch(0, k as u64, &what, ("s: keep the tool point of the cell file", Step::FIRST_BALL))?;
        if matches!(next, Next::To(_)) {
            self.cell.tool.tcp = self.about.cell.tool.tcp;
            self.write_cell()?;
        }
        Ok(next)
    }

    pub(super) fn tool_point(&mut self) -> Result<Next> {
        self.log = Some(self.open()?);
        if let Some(missing) = (0..ORIENTATIONS).find(|k| !self.rows.contains_key(&(*k as u64))) {
            return Ok(Next::To(1 + missing));
        }
        let rows: Vec<Row> = self.rows.range(..ORIENTATIONS as u64).map(|(_, row)| *row).collect();
        self.cell.tool.tcp = self.about.cell.tool.tcp;
        let Some(fit) = fitted("tool point", tool_point(self.about.robot, &self.cell, &rows))? else {
            return Ok(Next::To(1));
        };
        let mm = |v: [f64; 3]| v.map(|v| format!("{:.3}", v * 1e3)).join(", ");
        tell(&format!(
            "The tool point lies at {} mm from the flange (the cell file says {}); the four touches agree to {:.3} mm, the \
             error of the arm before calibration.",
            mm(fit.tcp_in_flange),
            mm(self.cell.tool.tcp.into()),
            fit.rms * 1e3
        ))?;
        match self.ask("Use it? (s: keep the tool point of the cell file; b: repeat the last touch.)")? {
            Answer::Back => return Ok(Next::Back),
            Answer::Skip => {}
            _ => self.cell.tool.tcp = fit.tcp_in_flange.into(),
        }
        self.write_cell()?;
        Ok(Next::On)
    }

    pub(super) fn ball(&mut self, k: usize) -> Result<Next> {
        if k == 0 {
            tell("3. World frame. Balls 1, 2 and 3 are touched once, in one orientation.")?;
        }
        let index = (ORIENTATIONS + k) as u64;
        let skipped = ("s: keep the base of the cell file", Step::PLAN);
        let next = self.touch(k, index, &format!("Ball {}", k + 1), skipped)?;
        if matches!(next, Next::To(_)) {
            self.cell.world_from_base = self.about.cell.world_from_base;
            self.write_cell()?;
        }
        Ok(next)
    }

    pub(super) fn world(&mut self) -> Result<Next> {
        self.log = Some(self.open()?);
        let rows: Vec<Row> = (0..BALLS).filter_map(|k| self.rows.get(&((ORIENTATIONS + k) as u64)).copied()).collect();
        let [a, b, c] = rows.as_slice() else { return Ok(Next::To(Step::FIRST_BALL)) };
        self.cell.world_from_base = self.about.cell.world_from_base;
        let Some(fit) = fitted("world frame", base(self.about.robot, &self.cell, [a, b, c]))? else {
            return Ok(Next::To(Step::FIRST_BALL));
        };
        for (a, b, found, expected) in fit.distances {
            tell(&format!(
                "Balls {a} and {b} are {:.2} mm apart, the cell file says {:.2} mm.",
                found * 1e3,
                expected * 1e3
            ))?;
        }
        if fit.check().is_err() {
            tell("An arm is never off by so much: was each touch at the right ball? Repeat the wrong ones.")?;
            return Ok(Next::To(Step::FIRST_BALL));
        }
        let file = &self.about.cell.world_from_base;
        let by = rotation_vector(&(file.rotation.transpose() * fit.world_from_base.rotation)).norm().to_degrees();
        let far = (file.translation - fit.world_from_base.translation).norm() * 1e3;
        tell(&format!(
            "The base of the arm has been found from the balls: {far:.1} mm and {by:.2} degrees from that of the cell file."
        ))?;
        // balls at equal distances do not tell that two were exchanged
        let answer = if by > BASE_TURNED_DEG {
            self.ask(
                "That is far: were the balls touched in another order than 1, 2, 3? Use it all the same? (s: keep the base of the \
                 cell file; b: repeat the touches.)",
            )?
        } else {
            Answer::Go
        };
        match answer {
            Answer::Back => return Ok(Next::To(Step::FIRST_BALL)),
            Answer::Skip => {}
            _ => self.cell.world_from_base = fit.world_from_base,
        }
        self.write_cell()?;
        Ok(Next::On)
    }
}
