//! `trical measure --guided`: mastering, tool point, world frame, plan and measurement, in plain words. What is done is kept beside the
//! recording (`checkpoint.rs`), so that `--resume` goes on with the step that was next.

mod ask;
mod checkpoint;
mod touches;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;

use trical_device::controller::{moved, wait_settled};
use trical_device::gauge::trial::{check_on_calibrator, master};
use trical_device::gauge::{bare_url, with_zero};
use trical_device::procedure::{MoveGuard, stride};
use trical_device::session::{Settings, now_ns};
use trical_device::{PlanEntry, Session, visits};
use trical_ident::write_whole;
use trical_model::{Cell, Joints, Robot, Row};
use trical_plan::{MotionGuard, PlanOptions, plan_touches, write_plan};
use trical_recording::RecordingWriter;
use trical_recording::mcap::check_same;
use trical_report::table;

use crate::commands::gauge::shown;
use crate::commands::plan;
use crate::error::{CliError, Result};
use crate::input::{RobotAndCell, quoted};
use crate::interrupt::Interrupt;
use crate::measure_view::{View, done, perform};
use crate::say;
use ask::{Answer, Person, tell};
use checkpoint::{Checkpoint, beside};

/// Orientations in which the first ball is touched for the tool point.
const ORIENTATIONS: usize = 4;

/// Balls that say where the arm stands.
const BALLS: usize = 3;

/// For touches where the arm stands: a person brought it there.
const FREE: MoveGuard<'static> = &|_, _, _| Ok(());

/// What a guided session begins with; gauge and cell get better on the way.
pub struct Guided<'a> {
    /// The arm.
    pub robot: &'a Robot,
    /// The cell as its file says.
    pub cell: Cell,
    /// Where both come from.
    pub files: &'a RobotAndCell,
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
    /// Whether to go on with a session that was broken off.
    pub resume: bool,
}

/// A step of a session; the order is that of [`Step::at`].
#[derive(Clone, Copy)]
enum Step {
    Master,
    Orientation(usize),
    ToolPoint,
    Ball(usize),
    World,
    Plan,
    Measure,
}

impl Step {
    /// Number of the first touch of a ball for the world frame, and of the plan.
    const FIRST_BALL: usize = 2 + ORIENTATIONS;
    const LAST_BALL: usize = Self::FIRST_BALL + BALLS - 1;
    const PLAN: usize = Self::LAST_BALL + 2;

    /// The step after so many.
    fn at(done: usize) -> Self {
        match done {
            0 => Self::Master,
            n if n <= ORIENTATIONS => Self::Orientation(n - 1),
            n if n < Self::FIRST_BALL => Self::ToolPoint,
            n if n <= Self::LAST_BALL => Self::Ball(n - Self::FIRST_BALL),
            n if n < Self::PLAN => Self::World,
            Self::PLAN => Self::Plan,
            _ => Self::Measure,
        }
    }
}

/// Where a step leads to.
enum Next {
    On,
    Back,
    To(usize),
    End,
}

/// A session under way.
struct Led<'a> {
    about: Guided<'a>,
    /// The cell as it was found so far.
    cell: Cell,
    checkpoint: Checkpoint,
    person: Person,
    /// Touches for tool point and world frame by their number.
    rows: BTreeMap<u64, Row>,
    log: Option<RecordingWriter>,
    /// The plan with its numbers of one round.
    plan: Option<(Vec<PlanEntry>, u64)>,
}

/// A file of a session that is gone.
fn missing(path: &Path) -> CliError {
    CliError::Input(format!(
        "{}: is missing, and the session cannot go on without it; choose another --out",
        path.display()
    ))
}

/// Without mastering.
fn not_mastered() -> Result<Next> {
    tell("No mastering: the indicators' readings are used as they are.")?;
    Ok(Next::On)
}

impl<'a> Guided<'a> {
    /// Leads a person through a whole session, or through what is left of it.
    pub fn lead(self) -> Result<()> {
        let mut led = self.begin()?;
        tell(
            "You will be led through a measurement. At each step: do what is said, then press Enter. Instead of Enter you \
             may type b to go back a step, s to skip the step, q to end, or the arm's joint angles in degrees (as in \
             0,10,20,0,45,0) to have the arm driven there slowly and straight: check that the way is free. Keep a hand \
             on the emergency stop. Every step is saved: --resume continues where you stopped.",
        )?;
        if led.checkpoint.step > 0 {
            let zero =
                led.checkpoint.zero.map_or("none".to_owned(), |zero| format!("the calibrator read {}", shown(&zero)));
            tell(&format!("The session goes on where it stopped. Mastering: {zero}."))?;
        }
        let ended = led.steps();
        let finished = led.close();
        ended.map_err(|e| match e {
            CliError::Failed(said) => CliError::Failed(format!("{said}; --guided --resume goes on with this step")),
            e => e,
        })?;
        finished
    }

    /// Reads what is there of a session.
    fn begin(self) -> Result<Led<'a>> {
        let files = ["setup.mcap", "cell.toml", "plan.csv", "guided.json"].map(|what| beside(self.out, what));
        if let Some(path) = files.iter().map(PathBuf::as_path).chain([self.out]).find(|path| path.exists())
            && !self.resume
        {
            let what = "exists already; --resume goes on with it, or choose another --out";
            return Err(CliError::Input(format!("{}: {what}", path.display())));
        }
        let balls = self.cell.balls.len();
        if balls < BALLS {
            let what = format!("the cell has {balls} balls, expected three or more for the world frame");
            return Err(CliError::Input(what));
        }
        let checkpoint = Checkpoint::load(self.out)?;
        let person = Person::listen(self.interrupt)?;
        let cell = self.cell.clone();
        let mut led = Led { about: self, cell, checkpoint, person, rows: BTreeMap::new(), log: None, plan: None };
        led.check_begun()?;
        led.read_cell()?;
        if led.checkpoint.step > Step::PLAN {
            let path = led.about.plan.map_or_else(|| beside(led.about.out, "plan.csv"), Path::to_owned);
            led.plan = Some(led.all_visits(&plan::load(&path, led.about.robot, led.cell.balls.len())?));
        }
        Ok(led)
    }

    /// Tells the whole run; nothing moves, and no file is written.
    pub fn tell_whole(self) -> Result<()> {
        let led = self.begin()?;
        let about = &led.about;
        tell("With --go, you are led through these steps, each when you press Enter:")?;
        let parts = [0, 1, Step::FIRST_BALL, Step::PLAN, Step::PLAN + 1, usize::MAX];
        for part in parts.windows(2).filter(|part| part[1] > led.checkpoint.step) {
            let at = part[0].max(led.checkpoint.step);
            let text = match Step::at(at) {
                Step::Master => {
                    "1. Mastering: the stems are read in the air and on the calibrator. Nothing moves.".to_owned()
                }
                Step::Orientation(k) => format!(
                    "2. Tool point: ball 1 in {} orientations. You bring the device over the ball each time; the arm then \
                     corrects by {:.1} mm at most at once, {:.1} mm in all, until the reading is below {:.3} mm. The tool point is \
                     computed; you accept it or keep that of the cell file.",
                    ORIENTATIONS - k,
                    about.settings.max_correction * 1e3,
                    about.settings.max_sum * 1e3,
                    about.settings.epsilon * 1e3
                ),
                Step::ToolPoint => {
                    "2. Tool point: it is computed; you accept it or keep that of the cell file.".to_owned()
                }
                Step::Ball(k) => format!(
                    "3. World frame: balls {} are touched once each in the same way. The base of the arm is computed and checked \
                     by the distances of the balls.",
                    (k + 1..=BALLS).map(|k| k.to_string()).collect::<Vec<_>>().join(", ")
                ),
                Step::World => {
                    "3. World frame: the base of the arm is computed and checked by the distances of the balls."
                        .to_owned()
                }
                Step::Plan => "4. Plan. From where the arm stands then; from joints at zero it is this one:".to_owned(),
                Step::Measure => "5. Measurement: the arm moves by itself.".to_owned(),
            };
            tell(&text)?;
            if matches!(Step::at(at), Step::Plan) {
                let (entries, _) = led.plan_from(None)?;
                tell(&format!("   {} touches.", entries.len()))?;
            }
        }
        let (entries, stride) = match &led.plan {
            Some(plan) => plan.clone(),
            None => led.plan_from(None)?,
        };
        let guard = MotionGuard::new(about.robot, &led.cell)?;
        let guard = |from: &Joints, to: &Joints, touched| guard.check(from, to, touched);
        let session =
            Session { stride: Some(stride), go: false, ..led.session(&led.cell, &entries, about.out, &guard) };
        let report = perform(&session, "", &mut |_| ())?;
        for w in &report.warnings {
            tell(&format!("Note: {w}."))?;
        }
        report.steps.iter().try_for_each(|step| say(format!("   {step}")))?;
        say("Nothing has moved. Add --go to measure.")
    }
}

impl Led<'_> {
    /// Refuses another arm or cell than those with which the session was begun: what was found since is not of them.
    fn check_begun(&self) -> Result<()> {
        let path = beside(self.about.out, "setup.mcap");
        if path.exists() {
            check_same(&path, &self.session(&self.about.cell, &[], &path, FREE).header())?;
            return Ok(());
        }
        if self.checkpoint.step > 1 { Err(missing(&path)) } else { Ok(()) }
    }

    /// The cell that was found before, if one was.
    fn read_cell(&mut self) -> Result<()> {
        let found = beside(self.about.out, "cell.toml");
        if found.exists() {
            (_, self.cell) = RobotAndCell { robot: self.about.files.robot.clone(), cell: found }.load()?;
        } else if self.checkpoint.step >= Step::PLAN {
            return Err(missing(&found));
        }
        Ok(())
    }

    /// Writes the cell as it was found, and goes on with what stands there: a resumed session has the same to the last digit.
    fn write_cell(&mut self) -> Result<()> {
        write_whole(&beside(self.about.out, "cell.toml"), self.cell.to_toml().as_bytes())?;
        self.read_cell()
    }

    /// One step after the other; where it stands is on disk before each.
    fn steps(&mut self) -> Result<()> {
        loop {
            let at = self.checkpoint.step;
            let next = match Step::at(at) {
                Step::Master => {
                    let before = self.checkpoint.zero;
                    let next = self.master()?;
                    if self.checkpoint.zero != before {
                        self.forget_touches()?;
                    }
                    next
                }
                Step::Orientation(k) => self.orientation(k)?,
                Step::ToolPoint => self.tool_point()?,
                Step::Ball(k) => self.ball(k)?,
                Step::World => self.world()?,
                Step::Plan => self.make_plan()?,
                Step::Measure => self.measure()?,
            };
            self.checkpoint.step = match next {
                Next::On => at + 1,
                Next::Back => at.saturating_sub(1),
                Next::To(step) => step,
                Next::End => return Ok(()),
            };
            self.checkpoint.save(self.about.out)?;
        }
    }

    /// The gauge with its mastering.
    fn gauge(&self) -> String {
        self.checkpoint
            .zero
            .map_or_else(|| self.about.gauge.clone(), |zero| with_zero(&bare_url(&self.about.gauge), zero))
    }

    fn session<'s>(
        &'s self,
        cell: &'s Cell,
        entries: &'s [PlanEntry],
        out: &'s Path,
        guard: MoveGuard<'s>,
    ) -> Session<'s> {
        let about = &self.about;
        Session {
            robot: about.robot,
            cell,
            plan: entries,
            stride: None,
            gauge: &about.gauge,
            controller: about.controller,
            out,
            resume: out.exists(),
            go: true,
            settings: about.settings,
            start_ns: now_ns(),
            guard,
            cancel: &about.interrupt.asked,
            stops: Some(Arc::clone(&about.interrupt.stops)),
        }
    }

    /// Asks with the live readings beside it; typed joint angles are driven to, and then it is asked again.
    fn ask(&self, text: &str) -> Result<Answer> {
        let about = &self.about;
        loop {
            let gauge = self.gauge();
            match self.person.ask(text, about.robot, Some((&gauge, about.controller)), about.settings.stroke)? {
                Answer::Joints(q) => {
                    if let Err(e) = self.drive(&q) {
                        tell(&format!("That did not work: {}", table::ended(&e.to_string())))?;
                    }
                }
                answer => return Ok(answer),
            }
        }
    }

    /// A straight way that the collision model allows from where the arm is; at a ball the stems may meet it.
    fn drive(&self, q: &Joints) -> std::result::Result<(), String> {
        let about = &self.about;
        let session = self.session(&self.cell, &[], about.out, FREE);
        let mut controller = session.open_controller().map_err(|e| e.to_string())?;
        let settle = controller.joint_settle();
        let at = wait_settled(controller.as_mut(), &settle, &about.interrupt.asked).map_err(|e| e.to_string())?;
        let guard = MotionGuard::new(about.robot, &self.cell).map_err(|e| e.to_string())?;
        let free = |ball| guard.check(&at, q, Some(ball)).is_ok();
        if let Err(why) = guard.check(&at, q, None)
            && !(0..self.cell.balls.len()).any(free)
        {
            return Err(format!(
                "the straight way there is refused ({why}) and was not driven; go there in smaller steps, or jog the arm by hand"
            ));
        }
        controller.set_speed(about.settings.touch_speed, 10_f64.to_radians()).map_err(|e| e.to_string())?;
        tell("The arm moves there.").map_err(|e| e.to_string())?;
        moved(controller.as_mut(), q).map_err(|e| e.to_string())
    }

    fn master(&mut self) -> Result<Next> {
        tell("1. Mastering. The calibrator defines the tool point, where the indicators read zero.")?;
        let cancel = Arc::clone(&self.about.interrupt.asked);
        // shown and read without an earlier mastering
        self.checkpoint.zero = None;
        let bare = bare_url(&self.about.gauge);
        loop {
            match self.ask("Hold the device so that no stem touches anything. (s: no mastering, the indicators are set to zero already.)")? {
                Answer::Go => {}
                Answer::Back => {
                    tell("This is the first step.")?;
                    continue;
                }
                _ => return not_mastered(),
            }
            let free = match master(&bare, &cancel) {
                Ok(read) => {
                    read.warnings.iter().try_for_each(|w| tell(&format!("Note: {w}.")))?;
                    read.zero
                }
                Err(e) => {
                    tell(&format!("That did not work: {} Try again.", table::ended(&e.to_string())))?;
                    continue;
                }
            };
            tell(&format!("In the air the stems read {}.", shown(&free)))?;
            match self.ask("Put the device on its calibrator so that all three stems touch it.")? {
                Answer::Go => {}
                Answer::Back => continue,
                _ => return not_mastered(),
            }
            match master(&bare, &cancel)
                .map_err(Into::into)
                .and_then(|m| check_on_calibrator(&free, &m.zero).map(|()| m.zero))
            {
                Ok(zero) => {
                    self.checkpoint.zero = Some(zero);
                    tell(&format!("The calibrator reads {}; from now on that is zero.", shown(&zero)))?;
                    return Ok(Next::On);
                }
                Err(e) => tell(&format!("That did not work: {} Try again.", table::ended(&e.to_string())))?,
            }
        }
    }

    /// Touches that were made with another mastering do not count any more; they stay in the recording.
    fn forget_touches(&mut self) -> Result<()> {
        if beside(self.about.out, "setup.mcap").exists() {
            let log = self.open()?;
            // its times are whole nanoseconds
            self.checkpoint.since = log.last_t() + 1e-6;
            self.log = Some(log);
        }
        if !self.rows.is_empty() {
            tell("The touches before were made with another zero: they are asked for again.")?;
        }
        self.rows.clear();
        Ok(())
    }

    /// A plan and its numbers of one round, with all visits; `start` = joints where the arm stands.
    fn plan_from(&self, start: Option<Joints>) -> Result<(Vec<PlanEntry>, u64)> {
        let about = &self.about;
        let found = if let Some(path) = about.plan {
            plan::load(path, about.robot, self.cell.balls.len())?
        } else {
            let nominal = plan::model_to_identify(about.robot, &self.cell)?;
            let options = PlanOptions {
                per_ball: about.per_ball,
                pool_per_ball: about.per_ball.max(100),
                parameters: Some(nominal.terms.clone()),
                start: start.or(Some(Joints::default())),
                ..PlanOptions::default()
            };
            let found = plan_touches(about.robot, &self.cell, &options, &trical_model::Task::silent())?;
            if start.is_some() {
                let text = write_plan(about.robot, &found.entries);
                write_whole(&beside(about.out, "plan.csv"), text.as_bytes())?;
            }
            plan::entries(&found.entries)
        };
        Ok(self.all_visits(&found))
    }

    /// All visits of a plan, and its numbers of one round.
    fn all_visits(&self, plan: &[PlanEntry]) -> (Vec<PlanEntry>, u64) {
        (visits(plan, self.about.settings.visits as usize), stride(plan))
    }

    fn make_plan(&mut self) -> Result<Next> {
        self.close()?;
        let found = beside(self.about.out, "cell.toml");
        tell(&format!("The cell as it was found is in {}.", found.display()))?;
        if self.about.plan.is_some() {
            self.plan = Some(self.plan_from(None)?);
            return Ok(Next::On);
        }
        tell("4. Plan. Touches are chosen that are free of collisions and tell most about the arm.")?;
        loop {
            match self.ask("Bring the arm to a free place. The measurement begins there.")? {
                // the base between is computed without a question
                Answer::Back => return Ok(Next::To(Step::LAST_BALL)),
                Answer::Go => {}
                _ => {
                    tell("Without a plan there is no measurement.")?;
                    continue;
                }
            }
            let opened = self.session(&self.cell, &[], self.about.out, FREE).open_controller();
            let start = opened.map_err(CliError::failed).and_then(|mut controller| {
                let settle = controller.joint_settle();
                wait_settled(controller.as_mut(), &settle, &self.about.interrupt.asked).map_err(CliError::failed)
            });
            match start.and_then(|start| self.plan_from(Some(start))) {
                Ok(plan) => {
                    let path = beside(self.about.out, "plan.csv");
                    tell(&format!("{} touches are planned ({}).", plan.0.len(), path.display()))?;
                    self.plan = Some(plan);
                    return Ok(Next::On);
                }
                Err(e) => tell(&format!("That did not work: {}", table::ended(&e.to_string())))?,
            }
        }
    }

    fn measure(&mut self) -> Result<Next> {
        let Some((entries, stride)) = self.plan.clone() else { return Ok(Next::To(Step::PLAN)) };
        tell("5. Measurement. Now the arm moves by itself; Ctrl-C stops it.")?;
        // the cell as it was found
        let guard = MotionGuard::new(self.about.robot, &self.cell)?;
        let guard = |from: &Joints, to: &Joints, touched| guard.check(from, to, touched);
        let mut text = format!("{} touches. Is everybody out of the cell?", entries.len());
        loop {
            match self.ask(&text)? {
                Answer::Go => {}
                // a plan that was given is taken without a question
                Answer::Back if !self.about.out.exists() && self.about.plan.is_some() => {
                    return Ok(Next::To(Step::LAST_BALL));
                }
                Answer::Back if !self.about.out.exists() => return Ok(Next::Back),
                Answer::Back => {
                    tell("The recording has begun: another cell or plan needs another --out.")?;
                    continue;
                }
                _ => return Err(CliError::Failed("ended by the user; nothing moves".into())),
            }
            let gauge = self.gauge();
            let session = self.session(&self.cell, &entries, self.about.out, &guard);
            let session = Session { stride: Some(stride), gauge: &gauge, ..session };
            let mut view = View::new();
            let result = perform(&session, "", &mut |p| view.show(&p));
            view.end();
            match result {
                Ok(report) => return self.measured(&report),
                Err(e) if self.about.interrupt.asked.load(Ordering::Relaxed) => return Err(e),
                Err(e) => {
                    tell(&format!("The measurement has stopped: {}", table::ended(&e.to_string())))?;
                    text = "Find the cause and remove it; then press Enter to go on where it stopped.".to_owned();
                }
            }
        }
    }

    fn measured(&self, report: &trical_device::RunReport) -> Result<Next> {
        for w in &report.warnings {
            tell(&format!("Note: {w}."))?;
        }
        tell(&format!("{}.", done(report, self.about.out)))?;
        let shown = |path: &Path| quoted(path.as_os_str().to_owned());
        say(format!(
            "Next: trical identify {} --robot {} --cell {} --out calibrated.toml",
            shown(self.about.out),
            shown(&self.about.files.robot),
            shown(&beside(self.about.out, "cell.toml"))
        ))?;
        Ok(Next::End)
    }
}
