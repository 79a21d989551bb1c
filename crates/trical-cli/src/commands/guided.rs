//! `trical measure --guided`: mastering, tool point, world frame, plan and measurement, in plain words.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use trical_device::controller::wait_settled;
use trical_device::gauge::trial::master;
use trical_device::procedure::{MoveGuard, stride};
use trical_device::session::{SetUpError, Settings, base, now_ns, tool_point};
use trical_device::{PlanEntry, Progress, Session, open_controller, visits};
use trical_ident::write_whole;
use trical_model::{Cell, JointKind, Joints, Robot, Row};
use trical_plan::{MotionGuard, PlanOptions, plan_touches, write_plan};
use trical_recording::RecordingWriter;
use trical_report::table;

use crate::commands::gauge::{shown, typed};
use crate::commands::plan;
use crate::error::{CliError, Result};
use crate::interrupt::Interrupt;
use crate::measure_view::View;
use crate::measure_view::{done, perform};
use crate::say;

/// Orientations in which the first ball is touched for the tool point.
const ORIENTATIONS: usize = 4;

/// For touches where the arm stands: a person brought it there.
const FREE: MoveGuard<'static> = &|_, _, _| Ok(());

/// What a guided session begins with; gauge and cell get better on the way.
pub struct Guided<'a> {
    /// The arm.
    pub robot: &'a Robot,
    /// The cell as it is known.
    pub cell: Cell,
    /// Gauge URL.
    pub gauge: String,
    /// Controller URL.
    pub controller: &'a str,
    /// Recording.
    pub out: &'a Path,
    /// A plan, where there is one.
    pub plan: Option<&'a Path>,
    /// Touches a ball, where there is none.
    pub per_ball: usize,
    /// How to measure.
    pub settings: &'a Settings,
    /// Set by Ctrl-C.
    pub interrupt: &'a Interrupt,
}

enum Answer {
    Go,
    Skip,
    Joints(Joints),
}

fn tell(text: &str) -> Result<()> {
    table::wrapped(text, 100, "").iter().try_for_each(say)
}

fn failed(e: impl std::fmt::Display) -> CliError {
    CliError::Failed(e.to_string())
}

impl Guided<'_> {
    /// Leads a person through a whole session.
    pub fn lead(mut self) -> Result<()> {
        let set_up = self.beside("setup.mcap");
        for path in [&set_up, &self.beside("cell.toml"), &self.beside("plan.csv"), &self.out.to_owned()] {
            if path.exists() {
                return Err(CliError::Input(format!("{}: exists already; choose another --out", path.display())));
            }
        }
        if self.cell.balls.len() < 3 {
            return Err(CliError::Input(format!(
                "the cell has {} balls, expected three or more for the world frame",
                self.cell.balls.len()
            )));
        }
        tell(
            "You will be led through a measurement. At each step: do what is said, then press Enter. Instead of Enter you \
             may type s to skip the step, q to end, or the arm's joint angles in degrees (as in 0,10,20,0,45,0) to have \
             the arm driven there slowly and straight: look that the way is free. Keep a hand on the emergency stop.",
        )?;
        self.master()?;
        let log =
            RecordingWriter::create(&set_up, &self.session(&[], &set_up, false, FREE).header()).map_err(failed)?;
        let log = self.touches(log)?;
        log.finish().map_err(failed)?;
        write_whole(&self.beside("cell.toml"), self.cell.to_toml().as_bytes())?;
        tell(&format!("The cell as it was found is in {}.", self.beside("cell.toml").display()))?;
        let entries = self.planned()?;
        self.measure(&visits(&entries, self.settings.visits as usize), stride(&entries))
    }

    fn beside(&self, what: &str) -> PathBuf {
        let stem = self.out.file_stem().unwrap_or_default().to_string_lossy();
        self.out.with_file_name(format!("{stem}.{what}"))
    }

    fn session<'s>(
        &'s self,
        entries: &'s [PlanEntry],
        out: &'s Path,
        resume: bool,
        guard: MoveGuard<'s>,
    ) -> Session<'s> {
        Session {
            robot: self.robot,
            cell: &self.cell,
            plan: entries,
            stride: None,
            gauge: &self.gauge,
            controller: self.controller,
            out,
            resume,
            go: true,
            settings: self.settings,
            start_ns: now_ns(),
            guard,
            cancel: &self.interrupt.asked,
            stops: Some(Arc::clone(&self.interrupt.stops)),
        }
    }

    fn ask(&self, text: &str) -> Result<Answer> {
        tell(&format!("> {text}"))?;
        loop {
            let line = typed()?;
            if self.interrupt.asked.load(std::sync::atomic::Ordering::Relaxed) {
                return Err(CliError::Failed("stopped by the user; nothing moves".into()));
            }
            let Some(line) = line else {
                return Err(CliError::Failed("standard input has ended before the session did".into()));
            };
            match line.as_str() {
                "" => return Ok(Answer::Go),
                "s" | "S" => return Ok(Answer::Skip),
                "q" | "Q" => return Err(CliError::Failed("ended by the user; nothing moves".into())),
                other => match self.joints(other) {
                    Ok(q) => return Ok(Answer::Joints(q)),
                    Err(e) => tell(&e)?,
                },
            }
        }
    }

    /// Joint angles as they are typed.
    fn joints(&self, text: &str) -> std::result::Result<Joints, String> {
        let words: Vec<&str> = text.split([',', ' ']).filter(|w| !w.is_empty()).collect();
        let numbers: Vec<f64> = words.iter().filter_map(|w| w.parse().ok()).collect();
        let dof = self.robot.dof();
        if numbers.len() != words.len() || numbers.len() != dof {
            return Err(format!("'{text}' is not understood: expected Enter, s, q, or {dof} joint angles"));
        }
        let mut q = [0.0; trical_model::MAX_JOINTS];
        for (k, (joint, v)) in self.robot.joints.iter().zip(&numbers).enumerate() {
            q[k] = if joint.kind == JointKind::Prismatic { v * 1e-3 } else { v.to_radians() };
            if !(joint.limits[0]..=joint.limits[1]).contains(&q[k]) {
                return Err(format!("joint {} at {v} is outside its limits", k + 1));
            }
        }
        Ok(q)
    }

    /// Asks until Enter or s; typed joint angles are driven to.
    fn ask_in_place(&self, text: &str) -> Result<bool> {
        loop {
            match self.ask(text)? {
                Answer::Go => return Ok(true),
                Answer::Skip => return Ok(false),
                Answer::Joints(q) => {
                    if let Err(e) = self.drive(&q) {
                        tell(&format!("That did not work: {e}."))?;
                    }
                }
            }
        }
    }

    /// A straight way that the collision model allows from where the arm is; at a ball the stems may meet it.
    fn drive(&self, q: &Joints) -> std::result::Result<(), String> {
        let mut controller = open_controller(self.controller).map_err(|e| e.to_string())?;
        let settle = controller.joint_settle();
        let at = wait_settled(controller.as_mut(), &settle, &self.interrupt.asked).map_err(|e| e.to_string())?;
        let guard = MotionGuard::new(self.robot, &self.cell).map_err(|e| e.to_string())?;
        let free = |ball| guard.check(&at, q, Some(ball)).is_ok();
        if let Err(why) = guard.check(&at, q, None)
            && !(0..self.cell.balls.len()).any(free)
        {
            return Err(format!(
                "the straight way there is refused ({why}) and was not driven; go there in smaller steps, or jog the arm by hand"
            ));
        }
        controller.set_speed(self.settings.touch_speed, 10_f64.to_radians()).map_err(|e| e.to_string())?;
        controller.stop_when(Arc::clone(&self.interrupt.stops));
        controller.move_joints(q).map_err(|e| e.to_string())
    }

    fn master(&mut self) -> Result<()> {
        tell("1. Mastering. The indicators have to know where the tool point is.")?;
        loop {
            let on = self.ask(
                "Put the device on its calibrator so that all three stems touch it. (s: they read zero already.)",
            )?;
            if !matches!(on, Answer::Go) {
                return tell("The readings are taken as they come.");
            }
            match master(&self.gauge, &self.interrupt.asked) {
                Ok(mastered) => {
                    self.gauge = mastered.url;
                    return tell(&format!("The calibrator reads {}; from now on that is zero.", shown(&mastered.zero)));
                }
                Err(e) => tell(&format!("That did not work: {e}."))?,
            }
        }
    }

    /// The touch where the arm stands: nulled and recorded; then the arm goes back to where it stood.
    fn touch_here(&self, log: &mut RecordingWriter, ball: usize, index: u64) -> std::result::Result<Row, String> {
        let mut note = |p| {
            if let Progress::Warning(w) = p {
                crate::note!("trical: note: {w}");
            }
        };
        let session = self.session(&[], self.out, false, FREE);
        session.touch_here(log, ball, index, &mut note).map_err(|e| e.to_string())
    }

    /// Asks for a touch until it is there; `None` where it is skipped.
    fn touch(&self, log: &mut RecordingWriter, ball: usize, index: u64, text: &str) -> Result<Option<Row>> {
        loop {
            if !self.ask_in_place(text)? {
                return Ok(None);
            }
            match self.touch_here(log, ball, index) {
                Ok(row) => return Ok(Some(row)),
                Err(e) => tell(&format!("That did not work: {e}. Try again."))?,
            }
        }
    }

    fn touches(&mut self, mut log: RecordingWriter) -> Result<RecordingWriter> {
        tell(
            "2. Tool point. Ball 1 is touched in four orientations that differ by 20 degrees or more, about two axes at \
             least: bring the device over the ball by hand until all three stems touch, near the middle of their stroke.",
        )?;
        let mut rows = Vec::new();
        for k in 0..ORIENTATIONS {
            let text =
                format!("Ball 1, orientation {} of {ORIENTATIONS}. (s: keep the tool point of the cell file.)", k + 1);
            let Some(row) = self.touch(&mut log, 0, k as u64, &text)? else { break };
            rows.push(row);
        }
        if rows.len() == ORIENTATIONS {
            self.tool_point(&rows)?;
        } else {
            tell("The tool point stays as it was.")?;
        }
        tell("3. World frame. Balls 1, 2 and 3 are touched once, in one orientation.")?;
        let mut rows = Vec::new();
        for ball in 0..3 {
            let text = format!("Ball {}. (s: keep the base of the cell file.)", ball + 1);
            let Some(row) = self.touch(&mut log, ball, (ORIENTATIONS + ball) as u64, &text)? else { break };
            rows.push(row);
        }
        if let [a, b, c] = rows.as_slice() {
            self.world([a, b, c])?;
        } else {
            tell("The base stays as it was.")?;
        }
        Ok(log)
    }

    fn tool_point(&mut self, rows: &[Row]) -> Result<()> {
        let fit = match tool_point(self.robot, &self.cell, rows) {
            Ok(fit) => fit,
            Err(e @ SetUpError::Model(_)) => return Err(CliError::Input(e.to_string())),
            Err(e) => return tell(&format!("No tool point: {e}. It stays as it was.")),
        };
        let mm = |v: [f64; 3]| v.map(|v| format!("{:.3}", v * 1e3)).join(", ");
        tell(&format!(
            "The tool point lies at {} mm from the flange (the cell file says {}); the four touches agree to {:.3} mm, which is \
             what the arm is off before calibration.",
            mm(fit.tcp_in_flange),
            mm(self.cell.tool.tcp.into()),
            fit.rms * 1e3
        ))?;
        if matches!(self.ask("Take it? (s: keep the one of the cell file.)")?, Answer::Go) {
            self.cell.tool.tcp = fit.tcp_in_flange.into();
        }
        Ok(())
    }

    fn world(&mut self, rows: [&Row; 3]) -> Result<()> {
        let fit = match base(self.robot, &self.cell, rows) {
            Ok(fit) => fit,
            Err(e @ SetUpError::Model(_)) => return Err(CliError::Input(e.to_string())),
            Err(e) => return tell(&format!("No world frame: {e}. The base stays as it was.")),
        };
        for (a, b, found, expected) in fit.distances {
            tell(&format!(
                "Balls {a} and {b} are {:.2} mm apart, the cell file says {:.2} mm.",
                found * 1e3,
                expected * 1e3
            ))?;
        }
        if fit.check().is_err() {
            return tell(
                "That is more than an arm can be off: was each touch at the ball that was asked for? The base stays as it was.",
            );
        }
        self.cell.world_from_base = fit.world_from_base;
        tell("The base of the arm has been found from the balls.")
    }

    fn planned(&self) -> Result<Vec<PlanEntry>> {
        if let Some(path) = self.plan {
            return plan::load(path, self.robot, self.cell.balls.len());
        }
        tell("4. Plan. Touches are chosen that collide with nothing and say most about the arm.")?;
        loop {
            if !self.ask_in_place("Bring the arm to a free place, from where the measurement is to begin.")? {
                return Err(CliError::Failed("without a plan there is no measurement".into()));
            }
            let start = open_controller(self.controller).and_then(|mut controller| {
                let settle = controller.joint_settle();
                wait_settled(controller.as_mut(), &settle, &self.interrupt.asked)
            });
            let start = match start {
                Ok(start) => start,
                Err(e) => {
                    tell(&format!("That did not work: {e}."))?;
                    continue;
                }
            };
            let nominal = plan::model_to_identify(self.robot, &self.cell)?;
            let options = PlanOptions {
                per_ball: self.per_ball,
                pool_per_ball: self.per_ball.max(100),
                parameters: Some(nominal.terms.clone()),
                start: Some(start),
                ..PlanOptions::default()
            };
            match plan_touches(self.robot, &self.cell, &options, &trical_model::Task::silent()) {
                Ok(found) => {
                    let path = self.beside("plan.csv");
                    write_whole(&path, write_plan(self.robot, &found.entries).as_bytes())?;
                    tell(&format!("{} touches are planned ({}).", found.entries.len(), path.display()))?;
                    return Ok(plan::entries(&found.entries));
                }
                Err(e) => tell(&format!("That did not work: {e}."))?,
            }
        }
    }

    fn measure(&self, entries: &[PlanEntry], stride: u64) -> Result<()> {
        tell("5. Measurement. Now the arm moves by itself; Ctrl-C stops it.")?;
        // the cell as it was found
        let guard = MotionGuard::new(self.robot, &self.cell)?;
        let guard = |from: &Joints, to: &Joints, touched| guard.check(from, to, touched);
        let mut resume = false;
        let mut text = format!("{} touches. Is everybody out of the cell?", entries.len());
        loop {
            if !matches!(self.ask(&text)?, Answer::Go) {
                return Err(CliError::Failed("ended by the user; nothing moves".into()));
            }
            let session = Session { stride: Some(stride), ..self.session(entries, self.out, resume, &guard) };
            let mut view = View::new();
            let result = perform(&session, &mut |p| view.show(&p));
            view.end();
            match result {
                Ok(report) => {
                    for w in &report.warnings {
                        tell(&format!("Note: {w}."))?;
                    }
                    tell(&format!("{}.", done(&report, self.out)))?;
                    return tell(&format!(
                        "Next: trical identify {} --robot ROBOT --cell {} --out calibrated.toml",
                        self.out.display(),
                        self.beside("cell.toml").display()
                    ));
                }
                Err(e) if self.interrupt.asked.load(std::sync::atomic::Ordering::Relaxed) => return Err(e),
                Err(e) => {
                    tell(&format!("The measurement has stopped: {e}."))?;
                    resume = self.out.exists();
                    text = "Look what it was; when it is well again, press Enter to go on where it stopped.".to_owned();
                }
            }
        }
    }
}
