//! What recordings say about themselves: which covariates they have, how loaded the joints were, when something may have
//! changed. Effects ask this before they ask the residual.

use trical_ident::dataset::{Dataset, Observation};
use trical_model::{Basis, Forward, Measured, Model, Shape, State, Variable};

use crate::settings::{
    CHANGE_POINTS, NO_LOAD_NM, NULLED_WITHIN_M, READING_SPREAD, SECONDS_PER_TOUCH, SMALL_ARM_LOAD_NM, WARM_UP_PARTS,
    WARM_UP_S,
};

/// A measure of how warm the arm is.
pub struct Clock {
    /// "with temperature".
    pub how: &'static str,
    /// Looks at temperature, or with a warm-up curve at what tells earlier from later.
    pub basis: Basis,
    /// By how much the basis changes over the data.
    pub rise: f64,
}

/// What tells earlier from later: time, or where it was not recorded the number of the pose.
#[must_use]
pub fn order_of(data: &Dataset) -> Option<Variable> {
    let all = |f: &dyn Fn(&State) -> bool| data.observations.iter().all(|o| f(&o.state));
    if all(&|s| s.t.is_some()) {
        Some(Variable::Time)
    } else if all(&|s| s.seq.is_some()) {
        Some(Variable::Seq)
    } else {
        None
    }
}

/// Whether a variable tells earlier from later.
#[must_use]
pub fn is_order(variable: Variable) -> bool {
    matches!(variable, Variable::Time | Variable::Seq)
}

/// A moment in words: "at 450 s", "at pose 450".
#[must_use]
pub fn moment(order: Variable, at: f64) -> String {
    if order == Variable::Seq { format!("at pose {:.0}", at.ceil()) } else { format!("at {at:.0} s") }
}

/// Seconds in each unit of what tells earlier from later.
#[must_use]
pub fn seconds_per(order: Variable) -> f64 {
    if order == Variable::Seq { SECONDS_PER_TOUCH } else { 1.0 }
}

/// Value of a variable that is part of the state itself.
#[must_use]
pub fn value(variable: Variable, state: &State) -> f64 {
    match variable {
        Variable::Joint { joint } => state.q[joint - 1],
        Variable::Time => state.t.unwrap_or(0.0),
        Variable::Seq => state.seq.unwrap_or(0.0),
        Variable::Temperature { reference_c } => state.temp_c.unwrap_or(reference_c) - reference_c,
        _ => 0.0,
    }
}

/// "q2", "time", "seq".
#[must_use]
pub fn name(variable: Variable) -> String {
    match variable {
        Variable::Joint { joint } => format!("q{joint}"),
        Variable::Time => "time".into(),
        Variable::Seq => "seq".into(),
        other => format!("{other:?}").to_lowercase(),
    }
}

/// What effects can look at.
#[expect(clippy::struct_excessive_bools, reason = "a list of yes and no")]
pub struct Covariates<'a> {
    /// The baseline.
    pub model: &'a Model,
    /// Senses of motion are known.
    pub direction: bool,
    /// Commanded joints stand beside read ones.
    pub commanded: bool,
    /// What tells earlier from later.
    pub order: Option<Variable>,
    /// There are touches.
    pub touches: bool,
    /// The robot has masses.
    pub masses: bool,
    /// Readings spread far beyond the noise: not every touch was nulled.
    pub spread: [bool; 3],
    /// Every touch was nulled, so far as readings tell.
    pub nulled: bool,
    /// Read joints lag behind commanded ones in the sense of motion.
    pub lags: bool,
    /// Measures of warmth, if any.
    pub clocks: Vec<Clock>,
    /// Number of poses.
    pub poses: usize,
    /// Duration, in units of what tells earlier from later.
    pub span: f64,
    /// They are those of one of several sessions.
    pub one_of_several: bool,
    loads: Vec<f64>,
    changes: Vec<f64>,
    /// Measuring frames of optical instruments, from 1.
    frames: Vec<usize>,
}

impl<'a> Covariates<'a> {
    /// `sigma` is the standard deviation (m) of a scalar residual of the baseline.
    #[must_use]
    pub fn new(model: &'a Model, data: &Dataset, sigma: f64) -> Self {
        let all = |f: &dyn Fn(&Observation) -> bool| data.observations.iter().all(f);
        let any = |f: &dyn Fn(&Observation) -> bool| data.observations.iter().any(f);
        let masses = model.robot.require_masses().is_ok();
        let order = order_of(data);
        let touches = any(&|o| matches!(o.measured, Measured::Touch { .. }));
        let spreads: [f64; 3] = std::array::from_fn(|k| reading_spread(data, k));
        let nulled_within = (READING_SPREAD * sigma).min(NULLED_WITHIN_M);
        Self {
            model,
            direction: all(&|o| o.state.dir.is_some())
                && any(&|o| o.state.dir.is_some_and(|d| d.iter().any(|s| *s != 0))),
            commanded: any(&|o| o.state.q_commanded.is_some_and(|c| c != o.state.q)),
            order,
            touches,
            masses,
            spread: spreads_beyond(data, sigma),
            nulled: touches && spreads.iter().all(|spread| *spread <= nulled_within),
            lags: lag_follows_motion(data),
            clocks: clocks(data, order),
            poses: data.used_poses().len(),
            span: order.map_or(1.0, |order| span(data, order)),
            one_of_several: false,
            loads: if masses { usual_loads(model, data) } else { vec![1.0; model.robot.dof()] },
            changes: order.map_or_else(Vec::new, |order| change_points(data, order, CHANGE_POINTS)),
            frames: seen_frames(data),
        }
    }

    /// The same; if it is known that touches were `deflected`, on every indicator.
    #[must_use]
    pub fn deflected(self, deflected: bool) -> Self {
        if deflected { Self { spread: [true; 3], nulled: false, ..self } } else { self }
    }

    /// The same of each session alone, with its number: what happens in the course of one is asked there.
    #[must_use]
    pub fn of_sessions(model: &'a Model, data: &Dataset, sigma: f64) -> Vec<(u32, Self)> {
        let mut sessions: Vec<u32> = data.observations.iter().filter_map(|o| o.state.session).collect();
        sessions.sort_unstable();
        sessions.dedup();
        let several = sessions.len() > 1;
        let of = |s: u32| {
            let data = data.filtered(|o| o.state.session == Some(s));
            let mut own = Self { one_of_several: several, ..Self::new(model, &data, sigma) };
            // when a session begins, the arm is as the other sessions say
            let when = |o: &Observation| own.order.map_or(0.0, |order| value(order, &o.state));
            let first = data.observations.iter().min_by(|a, b| when(a).total_cmp(&when(b)));
            if let Some(reference_c) = first.and_then(|o| o.state.temp_c) {
                for clock in own.clocks.iter_mut().filter(|c| matches!(c.basis.of, Variable::Temperature { .. })) {
                    clock.basis.of = Variable::Temperature { reference_c };
                }
            }
            (s, own)
        };
        sessions.into_iter().map(of).collect()
    }

    /// Number of joints.
    #[must_use]
    pub fn dof(&self) -> usize {
        self.model.robot.dof()
    }

    /// All joints, from 1.
    pub fn joints(&self) -> std::ops::RangeInclusive<usize> {
        1..=self.dof()
    }

    /// Frames of optical instruments, from 1.
    pub fn frames(&self) -> impl Iterator<Item = usize> + '_ {
        self.frames.iter().copied()
    }

    /// Moments at which something may have changed at once.
    #[must_use]
    pub fn changes(&self) -> &[f64] {
        &self.changes
    }

    /// Root mean square of a joint's gravity torque, N m.
    #[must_use]
    pub fn load(&self, joint: usize) -> f64 {
        self.loads[joint - 1]
    }

    /// Whether gravity does not turn a joint.
    #[must_use]
    pub fn unloaded(&self, joint: usize) -> bool {
        self.load(joint) <= NO_LOAD_NM
    }

    /// How many times the load of a small arm this one carries, at least 1. It is built that much stiffer, or it would hang down.
    #[must_use]
    pub fn strength(&self) -> f64 {
        self.loads.iter().fold(SMALL_ARM_LOAD_NM, |most, load| most.max(*load)) / SMALL_ARM_LOAD_NM
    }

    /// How far a joint gives way, rad/Nm: as it was fitted, but no less than a stiff joint of an arm of this strength does.
    #[must_use]
    pub fn compliance(&self, joint: usize) -> f64 {
        let fitted = self.model.terms.iter().find(|t| t.gives_way() == Some(joint));
        fitted.map_or(0.0, |t| t.value.abs()).max(3e-5 / self.strength())
    }
}

/// Measuring frames in which something was seen, from 1.
fn seen_frames(data: &Dataset) -> Vec<usize> {
    let mut frames: Vec<usize> =
        data.observations.iter().filter(|o| o.measured.is_framed()).map(|o| o.frame + 1).collect();
    frames.sort_unstable();
    frames.dedup();
    frames
}

fn clocks(data: &Dataset, order: Option<Variable>) -> Vec<Clock> {
    let t: Vec<f64> = data.observations.iter().filter_map(|o| o.state.temp_c).collect();
    if !t.is_empty() && t.len() == data.observations.len() {
        let reference_c = (trical_ident::rigid::median(&t) * 10.0).round() / 10.0;
        let rise = (t.iter().copied().fold(f64::MIN, f64::max) - t.iter().copied().fold(f64::MAX, f64::min)).max(0.1);
        let basis = Basis::new(Variable::Temperature { reference_c }, Shape::Linear);
        return vec![Clock { how: "with temperature", basis, rise }];
    }
    let Some(order) = order else { return Vec::new() };
    let warm_up = |constant| Clock {
        how: "as if the arm warmed up",
        basis: Basis::new(order, Shape::WarmUp { constant }),
        rise: 1.0,
    };
    let span = span(data, order);
    if order == Variable::Seq {
        return WARM_UP_PARTS.map(|part| warm_up(part * span)).into();
    }
    let longer = std::iter::successors(WARM_UP_S.last().copied(), |c| Some(2.0 * c)).skip(1).take_while(|c| *c <= span);
    WARM_UP_S.into_iter().chain(longer).map(warm_up).collect()
}

/// How long the data goes on; times are since the recording began, numbers may begin anywhere.
fn span(data: &Dataset, order: Variable) -> f64 {
    let of = || data.observations.iter().map(|o| value(order, &o.state));
    let first = if order == Variable::Time { 0.0 } else { of().fold(f64::INFINITY, f64::min) };
    (of().fold(0.0, f64::max) - first).max(1.0)
}

/// Root mean square of each joint's gravity torque over the data, N m; at least [`NO_LOAD_NM`].
fn usual_loads(model: &Model, data: &Dataset) -> Vec<f64> {
    let n = model.robot.dof();
    let mut squares = vec![0.0; n];
    if let Ok(forward) = Forward::new(model.clone(), Vec::new()) {
        let mut ws = forward.workspace();
        for o in &data.observations {
            let Ok(torques) = forward.gravity_torques(&o.state, &mut ws) else { continue };
            for (s, tau) in squares.iter_mut().zip(torques) {
                *s += tau * tau;
            }
        }
    }
    let count = data.observations.len().max(1) as f64;
    squares.into_iter().map(|s| (s / count).sqrt().max(NO_LOAD_NM)).collect()
}

/// Moments at which something may have changed: `count` quantiles of the data's, ends left out.
fn change_points(data: &Dataset, order: Variable, count: usize) -> Vec<f64> {
    let mut t: Vec<f64> = data.observations.iter().map(|o| value(order, &o.state)).collect();
    t.sort_by(f64::total_cmp);
    t.dedup();
    let n = t.len();
    if n < 8 {
        return Vec::new();
    }
    let count = count.min(n - 4);
    (1..=count)
        .map(|k| {
            let i = (2 + (k * (n - 4)) / (count + 1)).clamp(1, n - 1);
            0.5 * (t[i - 1] + t[i])
        })
        .collect()
}

/// Which readings spread far beyond a noise of `sigma`, m.
pub(crate) fn spreads_beyond(data: &Dataset, sigma: f64) -> [bool; 3] {
    std::array::from_fn(|axis| reading_spread(data, axis) > READING_SPREAD * sigma)
}

/// Standard deviation of the readings of one indicator, m.
pub(crate) fn reading_spread(data: &Dataset, axis: usize) -> f64 {
    let v: Vec<f64> = data
        .observations
        .iter()
        .filter_map(|o| match o.measured {
            Measured::Touch { reading, .. } => Some(reading[axis]),
            _ => None,
        })
        .collect();
    let n = v.len().max(1) as f64;
    let mean = v.iter().sum::<f64>() / n;
    (v.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt()
}

/// Whether commanded minus read angles go with the sense of the last motion (a joint that was read before it arrived is
/// behind) rather than being noise of either: mean of the sign, with its error.
fn lag_follows_motion(data: &Dataset) -> bool {
    let (mut sum, mut squares, mut n) = (0.0, 0.0, 0.0);
    for o in &data.observations {
        let (Some(c), Some(d)) = (o.state.q_commanded, o.state.dir) else { continue };
        for j in 0..data.dof {
            if d[j] != 0 {
                let lag = (c[j] - o.state.q[j]) * f64::from(d[j]);
                sum += lag;
                squares += lag * lag;
                n += 1.0;
            }
        }
    }
    let rms = (squares / f64::max(n, 1.0)).sqrt();
    sum / n > 0.2 * rms && sum > 5.0 * rms * f64::max(n, 1.0).sqrt()
}

#[cfg(test)]
mod tests;
