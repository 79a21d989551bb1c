//! The catalogue of effects: which terms each would add to the model, where, and how large it usually is.

use trical_model::{Axis, Basis, Forward, Measured, Model, Motion, Parameter, Payload, Shape, Site, Term, Variable};

use crate::dataset::Dataset;

/// One explanation that can be tried: the terms that it would add.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Name in the catalogue.
    pub effect: &'static str,
    /// Where, as the contract writes sites.
    pub site: serde_json::Value,
    /// In words: what the residuals would do.
    pub located: String,
    /// Terms with coefficient 0.
    pub terms: Vec<Term>,
    /// Sign that each coefficient must have to be physics; 0 where both are possible.
    pub signs: Vec<i8>,
    /// Typical size of a coefficient, SI, for saying beforehand what the data could show.
    pub typical: f64,
    /// Prior standard deviation of each coefficient, SI: half of the large end of what is usual. A coefficient beyond that is not
    /// forbidden, but must be paid for: this is what keeps two columns that nearly cancel from being blown up to fit noise.
    pub scales: Vec<f64>,
    /// Logarithm of the prior: uniform over families, then sites, then scan points.
    pub log_prior: f64,
}

impl Candidate {
    /// Variable and place of a step, if it is one (all its terms step together).
    #[must_use]
    pub fn step(&self) -> Option<(Variable, f64)> {
        match self.terms.first()?.basis {
            Basis { of, shape: Shape::Step { at }, sense: None } => Some((of, at)),
            _ => None,
        }
    }

    /// The same with its step elsewhere.
    #[must_use]
    pub fn with_step(&self, at: f64) -> Self {
        let mut other = self.clone();
        for t in &mut other.terms {
            t.basis.shape = Shape::Step { at };
        }
        if self.terms[0].basis.of == Variable::Time
            && let Some((what, _)) = self.located.rsplit_once(" at ")
        {
            other.located = format!("{what} at {at:.0} s");
        }
        other
    }

    /// Whether it only changes slowly, with time or temperature: noise that remembers itself looks like that.
    #[must_use]
    pub fn slow(&self) -> bool {
        self.terms.iter().all(|t| slow(&t.basis))
    }

    /// Whether it is a step or a curve rather than a wave.
    #[must_use]
    pub fn scanned(&self) -> bool {
        self.terms.iter().all(|t| matches!(t.basis.shape, Shape::Step { .. } | Shape::Tent { .. }))
    }
}

/// Whether a basis changes with time or temperature alone.
fn slow(basis: &Basis) -> bool {
    matches!(basis.of, Variable::Time | Variable::Temperature { .. }) && basis.sense.is_none()
}

/// A family of the catalogue that this data cannot test, and what is missing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Untestable {
    /// Name in the catalogue.
    pub effect: &'static str,
    /// What the recordings lack.
    pub lacks: &'static str,
}

struct Builder<'a> {
    model: &'a Model,
    families: Vec<(&'static str, Vec<Candidate>)>,
    untestable: Vec<Untestable>,
}

/// A gear's ripple of `cycles` per turn. Which frequencies are worth a try, a periodogram says; the prior counts all.
#[must_use]
pub fn ripple(joint: usize, cycles: f64, joints: usize) -> Candidate {
    let (from, to) = super::periodogram::GEARS;
    let at = Site::Joint { joint };
    let q = Variable::Joint { joint };
    let term = |part: &str, shape| Term::new(format!("ripple_{part}_{joint}"), "gear_ripple", at, Basis::new(q, shape));
    #[expect(clippy::cast_precision_loss, reason = "counts")]
    let ways = (FAMILIES * joints) as f64 * f64::from(to - from + 1);
    Candidate {
        effect: "gear_ripple",
        site: joint_site(joint),
        located: format!("{cycles:.0} cycles per turn of joint {joint}"),
        terms: vec![term("sine", Shape::Sine { cycles }), term("cosine", Shape::Cosine { cycles })],
        signs: vec![0; 2],
        typical: arcsec(15.0),
        scales: vec![arcsec(15.0); 2],
        log_prior: -ways.ln(),
    }
}

/// Families that compete: the prior is uniform over them, then over sites, then over scan points.
const FAMILIES: usize = 24;

fn arcsec(seconds: f64) -> f64 {
    (seconds / 3600.0).to_radians()
}

fn joint_site(joint: usize) -> serde_json::Value {
    serde_json::json!({ "joint": joint })
}

impl Builder<'_> {
    fn family(&mut self, effect: &'static str) -> &mut Vec<Candidate> {
        if let Some(k) = self.families.iter().position(|f| f.0 == effect) {
            return &mut self.families[k].1;
        }
        self.families.push((effect, Vec::new()));
        let last = self.families.len() - 1;
        &mut self.families[last].1
    }

    /// Adds a candidate; `parts` are name, site, basis and sign of each coefficient, `size` what is typical and what is large
    /// (two standard deviations).
    fn add(
        &mut self,
        effect: &'static str,
        site: serde_json::Value,
        located: String,
        size: (f64, f64),
        parts: Vec<(String, Site, Basis, i8)>,
    ) {
        let scales = vec![0.5 * size.1; parts.len()];
        self.add_scaled(effect, site, located, size.0, parts, scales);
    }

    /// As `add`, with a large size for each coefficient where their units differ.
    fn add_scaled(
        &mut self,
        effect: &'static str,
        site: serde_json::Value,
        located: String,
        typical: f64,
        parts: Vec<(String, Site, Basis, i8)>,
        scales: Vec<f64>,
    ) {
        let signs = parts.iter().map(|p| p.3).collect();
        let terms = parts.into_iter().map(|(name, site, basis, _)| Term::new(name, effect, site, basis)).collect();
        self.family(effect).push(Candidate { effect, site, located, terms, signs, typical, scales, log_prior: 0.0 });
    }

    fn lacks(&mut self, effects: &[&'static str], lacks: &'static str) {
        self.untestable.extend(effects.iter().map(|effect| Untestable { effect, lacks }));
    }

    fn dof(&self) -> usize {
        self.model.robot.dof()
    }

    /// How far a joint gives way, rad/Nm: as it was fitted, but no less than a stiff joint of a small arm does.
    fn compliance(&self, joint: usize) -> f64 {
        let torque = Basis::torque(joint, Shape::Linear);
        let fitted = self.model.terms.iter().find(|t| t.site == Site::Joint { joint } && t.basis == torque);
        fitted.map_or(0.0, |t| t.value.abs()).max(3e-5)
    }
}

/// What of a recording the bases can look at.
#[expect(clippy::struct_excessive_bools, reason = "a list of yes and no")]
struct Has {
    direction: bool,
    commanded: bool,
    time: bool,
    temperature: bool,
    touches: bool,
    frames: bool,
    masses: bool,
    /// Readings spread far beyond the noise: not every touch was nulled.
    spread: [bool; 3],
    /// Read joints lag behind commanded ones in the sense of motion.
    lags: bool,
}

fn has(model: &Model, data: &Dataset, sigma: f64) -> Has {
    let all = |f: &dyn Fn(&crate::dataset::Observation) -> bool| data.observations.iter().all(f);
    let any = |f: &dyn Fn(&crate::dataset::Observation) -> bool| data.observations.iter().any(f);
    Has {
        direction: all(&|o| o.state.dir.is_some()) && any(&|o| o.state.dir.is_some_and(|d| d.iter().any(|s| *s != 0))),
        commanded: any(&|o| o.state.q_commanded.is_some_and(|c| c != o.state.q)),
        time: all(&|o| o.state.t.is_some()),
        temperature: all(&|o| o.state.temp_c.is_some()),
        touches: any(&|o| matches!(o.measured, Measured::Touch { .. })),
        frames: any(&|o| matches!(o.measured, Measured::Point { .. } | Measured::Pose { .. })),
        masses: model.robot.require_masses().is_ok(),
        spread: std::array::from_fn(|k| reading_spread(data, k) > SPREAD * sigma),
        lags: lag_follows_motion(data),
    }
}

/// Indicator readings must spread this many times beyond the residual noise before their gain can be asked for. The noise of
/// a reading stands in the residual and in the regressor, which biases a gain by -(noise / spread)^2: by 1 % at ten.
const SPREAD: f64 = 10.0;

/// Standard deviation of the readings of one indicator, m.
fn reading_spread(data: &Dataset, axis: usize) -> f64 {
    let v: Vec<f64> = data
        .observations
        .iter()
        .filter_map(|o| match o.measured {
            Measured::Touch { reading, .. } => Some(reading[axis]),
            _ => None,
        })
        .collect();
    #[expect(clippy::cast_precision_loss, reason = "a count")]
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
    rms > 0.0 && sum / n > 0.2 * rms && sum > 5.0 * rms * f64::max(n, 1.0).sqrt()
}

/// Terms that are about the noise of the readings, not about the arm. Where every touch was nulled, what an indicator still
/// reads is mostly its own noise, and believing a share of it is better than believing all; where commanded and read joints
/// differ by noise, a share of that helps likewise. They are fitted with the baseline if they pay, and never named as effects.
#[must_use]
pub fn reading_noise(model: &Model, data: &Dataset, sigma: f64) -> Vec<Candidate> {
    let has = has(model, data, sigma);
    let mut b = Builder { model, families: Vec::new(), untestable: Vec::new() };
    if has.touches && has.spread == [false; 3] {
        let parts = Axis::ALL
            .iter()
            .map(|axis| {
                let basis = Basis::new(Variable::Reading { axis: *axis }, Shape::Linear);
                (format!("disbelief_{}", axis.name()), Site::Tool(Motion::Along(*axis)), basis, -1)
            })
            .collect();
        b.add(
            "reading_noise",
            serde_json::json!({ "tool": true }),
            "nulled readings are mostly noise".into(),
            (0.0, 1.0),
            parts,
        );
    }
    if has.commanded && !has.lags {
        let basis = Basis::new(Variable::Lag { joint: 1 }, Shape::Linear);
        b.add(
            "joint_reading_noise",
            serde_json::json!({ "joints": true }),
            "read joints are noisier than commanded ones".into(),
            (0.0, 1.0),
            vec![("belief_in_commanded".into(), Site::AllJoints, basis, 1)],
        );
    }
    b.families.into_iter().flat_map(|f| f.1).collect()
}

/// Loads below this (N m) are none.
const UNLOADED: f64 = 0.1;

/// Root mean square of each joint's gravity torque over the data, N m; at least [`UNLOADED`].
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
    #[expect(clippy::cast_precision_loss, reason = "a count")]
    let count = data.observations.len().max(1) as f64;
    squares.into_iter().map(|s| (s / count).sqrt().max(UNLOADED)).collect()
}

/// How the device is turned about the last axis: touches that were nulled do not see it, deflected ones do, and a zero of the
/// last joint that is off turns the device. Belongs to the geometry; `None` where all touches were nulled.
#[must_use]
pub fn device_orientation(model: &Model, data: &Dataset, sigma: f64) -> Option<Term> {
    let spread = has(model, data, sigma).spread;
    let term = || Term::new("device_z", "geometry", Site::Tool(Motion::About(Axis::Z)), Basis::CONSTANT);
    (spread[0] || spread[1]).then(term)
}

/// Times at which something may have changed: `count` quantiles of the data's times, ends left out.
fn change_points(data: &Dataset, count: usize) -> Vec<f64> {
    let mut t: Vec<f64> = data.observations.iter().filter_map(|o| o.state.t).collect();
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

/// All candidates that this data can be asked about, with priors, and the families that it cannot test. `sigma` is the
/// standard deviation (m) of a scalar residual of the baseline.
#[must_use]
pub fn catalogue(model: &Model, data: &Dataset, sigma: f64) -> (Vec<Candidate>, Vec<Untestable>) {
    let has = has(model, data, sigma);
    let mut b = Builder { model, families: Vec::new(), untestable: Vec::new() };
    let loads = if has.masses { usual_loads(model, data) } else { vec![1.0; model.robot.dof()] };
    joint_angle_effects(&mut b);
    axis_effects(&mut b);
    if has.direction {
        direction_effects(&mut b, &has, &loads);
    } else {
        b.lacks(&["lost_motion_direction", "load_friction"], "the sense of each joint's last motion (dir1 ...)");
    }
    if has.masses {
        torque_effects(&mut b, &loads);
    } else {
        b.lacks(
            &["lost_motion_gravity", "nonlinear_stiffness", "cross_axis_compliance", "gravity_direction", "payload"],
            "masses of the links (robot.toml)",
        );
    }
    if has.time {
        let points = change_points(data, 60);
        time_effects(&mut b, &has, &points, data);
    } else {
        b.lacks(
            &["joint_zero_shift", "fixture_shift", "fixture_drift", "tool_shift", "tool_drift", "frame_drift"],
            "time (t_s)",
        );
    }
    thermal_effects(&mut b, &has, data);
    if has.touches {
        gauge_effects(&mut b, &has);
    }
    match (has.commanded, has.lags) {
        (true, true) => late_reading(&mut b),
        (true, false) => {
            b.lacks(&["late_joint_reading"], "read joints that lag behind commanded ones: these had settled")
        }
        _ => b.lacks(&["late_joint_reading"], "commanded beside read joints (qc1_deg ...)"),
    }
    let mut all = Vec::new();
    for (_, mut list) in b.families {
        let mut sites: Vec<serde_json::Value> = Vec::new();
        for c in &list {
            if !sites.contains(&c.site) {
                sites.push(c.site.clone());
            }
        }
        let scans: Vec<usize> = sites.iter().map(|s| list.iter().filter(|c| c.site == *s).count()).collect();
        for c in &mut list {
            let scan = sites.iter().position(|s| *s == c.site).map_or(1, |k| scans[k]);
            #[expect(clippy::cast_precision_loss, reason = "counts")]
            let ways = (FAMILIES * sites.len() * scan) as f64;
            c.log_prior = -ways.ln();
        }
        all.append(&mut list);
    }
    (all, b.untestable)
}

fn joint_angle_effects(b: &mut Builder<'_>) {
    let n = b.dof();
    let q = |joint| Variable::Joint { joint };
    for joint in 1..=n {
        let at = Site::Joint { joint };
        for k in 1..=6_u8 {
            let cycles = f64::from(k);
            b.add(
                "joint_harmonic",
                joint_site(joint),
                format!("{k} cycle{} per turn of joint {joint}", if k == 1 { "" } else { "s" }),
                (0.015_f64.to_radians(), 0.03_f64.to_radians()),
                vec![
                    (format!("sine_{k}_{joint}"), at, Basis::new(q(joint), Shape::Sine { cycles }), 0),
                    (format!("cosine_{k}_{joint}"), at, Basis::new(q(joint), Shape::Cosine { cycles }), 0),
                ],
            );
        }
        b.add(
            "gear_ratio",
            joint_site(joint),
            format!("in proportion to joint {joint}'s angle"),
            (5e-4, 1e-3),
            vec![(format!("ratio_{joint}"), at, Basis::new(q(joint), Shape::Linear), 0)],
        );
    }
    for (to, from) in [(5, 4), (6, 5), (6, 4), (3, 2)] {
        if to <= n {
            b.add(
                "joint_coupling",
                serde_json::json!({ "joint": to, "from": from }),
                format!("joint {to} moves in proportion to joint {from}'s angle"),
                (8e-4, 2e-3),
                vec![(
                    format!("coupling_{to}_from_{from}"),
                    Site::Joint { joint: to },
                    Basis::new(q(from), Shape::Linear),
                    0,
                )],
            );
        }
    }
}

fn axis_effects(b: &mut Builder<'_>) {
    let n = b.dof();
    for link in 1..n {
        let near_parallel = b.model.robot.joints[link].alpha.sin().abs() < 0.1;
        if near_parallel {
            b.add(
                "axis_twist",
                joint_site(link + 1),
                format!("axis {} is twisted against axis {link} about y", link + 1),
                (0.03_f64.to_radians(), 0.1_f64.to_radians()),
                vec![(format!("beta_{link}"), Site::Link { link, parameter: Parameter::Beta }, Basis::CONSTANT, 0)],
            );
        }
    }
    for joint in 1..=n {
        for k in 1..=2_u8 {
            let cycles = f64::from(k);
            let q = Variable::Joint { joint };
            let mut parts = Vec::new();
            for axis in [Axis::X, Axis::Y] {
                let at = Site::Tilt { joint, axis };
                let name = axis.name();
                parts.push((format!("wobble_{name}_sine_{k}_{joint}"), at, Basis::new(q, Shape::Sine { cycles }), 0));
                parts.push((
                    format!("wobble_{name}_cosine_{k}_{joint}"),
                    at,
                    Basis::new(q, Shape::Cosine { cycles }),
                    0,
                ));
            }
            b.add(
                "axis_wobble",
                joint_site(joint),
                format!("axis {joint} tilts {k} time{} a turn", if k == 1 { "" } else { "s" }),
                (0.01_f64.to_radians(), 0.03_f64.to_radians()),
                parts,
            );
        }
    }
}

fn direction_effects(b: &mut Builder<'_>, has: &Has, loads: &[f64]) {
    for joint in 1..=b.dof() {
        let at = Site::Joint { joint };
        b.add(
            "lost_motion_direction",
            joint_site(joint),
            format!("changes sign with the sense of joint {joint}'s last motion"),
            (arcsec(15.0), arcsec(60.0)),
            vec![(format!("half_gap_{joint}"), at, Basis::direction(joint), -1)],
        );
        if has.masses {
            let load = Basis { sense: Some(joint), ..Basis::torque(joint, Shape::Absolute) };
            let by_load = (format!("friction_by_load_{joint}"), at, load, -1);
            let always = (format!("friction_{joint}"), at, Basis::direction(joint), -1);
            let size = arcsec(30.0);
            // an axis that gravity does not turn has no load: what is left of the effect is another one
            let (terms, scales) = if loads[joint - 1] <= UNLOADED {
                (vec![by_load], vec![size / UNLOADED])
            } else {
                (vec![always, by_load], vec![size, size / loads[joint - 1]])
            };
            b.add_scaled(
                "load_friction",
                joint_site(joint),
                format!("changes sign with the sense of joint {joint}'s last motion, and grows with its load"),
                arcsec(15.0),
                terms,
                scales,
            );
        }
    }
}

fn torque_effects(b: &mut Builder<'_>, loads: &[f64]) {
    let n = b.dof();
    for joint in 1..=n {
        let at = Site::Joint { joint };
        let load = loads[joint - 1];
        // Nm; what softens the change of flank is friction and preload, a small part of what the joint bears
        let softness: [f64; 5] = [0.05, 0.15, 0.4, 1.0, 2.5];
        for scale in softness.into_iter().filter(|s| *s <= softness[0].max(load / 4.0)) {
            b.add(
                "lost_motion_gravity",
                joint_site(joint),
                format!("follows the sign of joint {joint}'s gravity torque"),
                (0.01_f64.to_radians(), 0.02_f64.to_radians()),
                vec![(format!("half_gap_gravity_{joint}"), at, Basis::torque(joint, Shape::SoftSign { scale }), 1)],
            );
        }
        // half of what the joint gives way in proportion to its torque, at the torque that it usually bears
        let usual = b.compliance(joint) * load;
        let stiffness = [
            ("square", Shape::SignedSquare),
            ("cube", Shape::Cube),
            ("soft_third", Shape::SoftSign { scale: load / 3.0 }),
            ("soft_two_thirds", Shape::SoftSign { scale: load / 1.5 }),
            ("soft", Shape::SoftSign { scale: 1.25 * load }),
            ("soft_twice", Shape::SoftSign { scale: 2.5 * load }),
        ];
        for (name, shape) in stiffness {
            let at_load = shape.at(load).0.abs();
            let size = (0.25 * usual / at_load, 0.5 * usual / at_load);
            b.add(
                "nonlinear_stiffness",
                joint_site(joint),
                format!("joint {joint} does not give way in proportion to its torque"),
                size,
                vec![(format!("stiffness_{name}_{joint}"), at, Basis::torque(joint, shape), 0)],
            );
        }
        b.add(
            "cross_axis_compliance",
            joint_site(joint),
            format!("the gravity moment across axis {joint} tilts it"),
            (5e-5, 4e-4),
            vec![(
                format!("cross_{joint}"),
                Site::Across { joint },
                Basis::new(Variable::Moment { joint, axis: Axis::X }, Shape::Linear),
                1,
            )],
        );
    }
    b.add(
        "gravity_direction",
        serde_json::json!({ "base": true }),
        "gravity is not along the cell's -z".into(),
        (9.8 * 1.0_f64.to_radians(), 9.8 * 2.0_f64.to_radians()),
        vec![
            ("gravity_x".into(), Site::Gravity(Axis::X), Basis::CONSTANT, 0),
            ("gravity_y".into(), Site::Gravity(Axis::Y), Basis::CONSTANT, 0),
        ],
    );
    let mut parts: Vec<(String, Site, Basis, i8)> = Axis::ALL
        .iter()
        .map(|a| (format!("payload_moment_{}", a.name()), Site::Payload(Payload::Moment(*a)), Basis::CONSTANT, 0))
        .collect();
    parts.insert(0, ("payload_mass".into(), Site::Payload(Payload::Mass), Basis::CONSTANT, 0));
    let tool = serde_json::json!({ "tool": true });
    let located = "the load on the flange is not what cell.toml says".into();
    b.add_scaled("payload", tool, located, 0.03, parts, vec![0.5, 0.05, 0.05, 0.05]);
}

fn along(site: impl Fn(Motion) -> Site, name: &str, basis: Basis) -> Vec<(String, Site, Basis, i8)> {
    Axis::ALL.iter().map(|a| (format!("{name}_{}", a.name()), site(Motion::Along(*a)), basis, 0)).collect()
}

fn time_effects(b: &mut Builder<'_>, has: &Has, points: &[f64], data: &Dataset) {
    let span = data.observations.iter().filter_map(|o| o.state.t).fold(0.0, f64::max).max(1.0);
    let drift = Basis::new(Variable::Time, Shape::Linear);
    for at in points {
        let step = Basis::new(Variable::Time, Shape::Step { at: *at });
        let when = format!("changes at once at {at:.0} s");
        for joint in 1..=b.dof() {
            b.add(
                "joint_zero_shift",
                joint_site(joint),
                format!("joint {joint}'s zero {when}"),
                (0.02_f64.to_radians(), 0.06_f64.to_radians()),
                vec![(format!("zero_shift_{joint}"), Site::Joint { joint }, step, 0)],
            );
        }
        b.add(
            "tool_shift",
            serde_json::json!({ "tool": true }),
            format!("the tool on the flange {when}"),
            (1e-4, 2.5e-4),
            along(Site::Tool, "tool_shift", step),
        );
        if has.touches {
            b.add(
                "fixture_shift",
                serde_json::json!({ "fixture": true }),
                format!("the place of the balls {when}"),
                (1e-4, 2.5e-4),
                along(Site::Fixture, "fixture_shift", step),
            );
        }
    }
    b.add(
        "tool_drift",
        serde_json::json!({ "tool": true }),
        "the tool creeps on the flange with time".into(),
        (1e-4 / span, 2.5e-4 / span),
        along(Site::Tool, "tool_drift", drift),
    );
    if has.touches {
        b.add(
            "fixture_drift",
            serde_json::json!({ "fixture": true }),
            "the balls creep with time".into(),
            (1e-4 / span, 2.5e-4 / span),
            along(Site::Fixture, "fixture_drift", drift),
        );
    }
    if has.frames {
        for frame in 1..=data.frames() {
            let parts = Motion::ALL
                .iter()
                .map(|m| (format!("frame_drift_{}", m.name()), Site::Frame { frame, motion: *m }, drift, 0))
                .collect();
            b.add(
                "frame_drift",
                serde_json::json!({ "frame": true }),
                "the measuring frame moves with time".into(),
                (1e-4 / span, 2e-4 / span),
                parts,
            );
        }
    }
}

fn thermal_effects(b: &mut Builder<'_>, has: &Has, data: &Dataset) {
    let mut clocks: Vec<(&'static str, Basis, f64)> = Vec::new();
    if has.temperature {
        let t: Vec<f64> = data.observations.iter().filter_map(|o| o.state.temp_c).collect();
        let reference_c = (crate::rigid::median(&t) * 10.0).round() / 10.0;
        let rise = (t.iter().copied().fold(f64::MIN, f64::max) - t.iter().copied().fold(f64::MAX, f64::min)).max(0.1);
        clocks.push(("with temperature", Basis::new(Variable::Temperature { reference_c }, Shape::Linear), rise));
    } else if has.time {
        for constant in [600.0, 1800.0, 5400.0] {
            clocks.push(("as the arm warms up", Basis::new(Variable::Time, Shape::WarmUp { constant }), 1.0));
        }
    }
    if clocks.is_empty() {
        b.lacks(&["thermal_growth", "thermal_zero_drift"], "temperature (temp_c) or time (t_s)");
    }
    for (how, basis, rise) in clocks {
        b.add(
            "thermal_growth",
            serde_json::json!({ "links": true }),
            format!("all lengths grow {how}"),
            if basis.of == Variable::Time { (18e-6 * 6.0, 26e-6 * 10.0) } else { (18e-6, 26e-6) },
            vec![("expansion".into(), Site::Links, basis, 1)],
        );
        for joint in 1..=b.dof() {
            b.add(
                "thermal_zero_drift",
                joint_site(joint),
                format!("joint {joint}'s zero moves {how}"),
                (0.02_f64.to_radians() / rise, 0.06_f64.to_radians() / rise),
                vec![(format!("thermal_zero_{joint}"), Site::Joint { joint }, basis, 0)],
            );
        }
    }
}

fn gauge_effects(b: &mut Builder<'_>, has: &Has) {
    if has.spread != [true; 3] {
        b.lacks(&["indicator_gain"], "readings with a spread: each touch was nulled to within the noise");
    }
    for axis in Axis::ALL {
        let at = Site::Tool(Motion::Along(axis));
        let site = serde_json::json!({ "axis": axis.name() });
        if has.spread[axis.index()] {
            b.add(
                "indicator_gain",
                site.clone(),
                format!("in proportion to indicator {}'s own reading", axis.name()),
                (0.02, 0.08),
                vec![(format!("gain_{}", axis.name()), at, Basis::new(Variable::Reading { axis }, Shape::Linear), 0)],
            );
        }
        let others: Vec<(String, Site, Basis, i8)> = Axis::ALL
            .iter()
            .filter(|a| **a != axis)
            .map(|a| {
                (
                    format!("skew_{}_by_{}", axis.name(), a.name()),
                    at,
                    Basis::new(Variable::Reading { axis: *a }, Shape::Linear),
                    0,
                )
            })
            .collect();
        b.add(
            "indicator_skew",
            site.clone(),
            format!("indicator {} sees what the others read", axis.name()),
            (1.0_f64.to_radians(), 1.5_f64.to_radians()),
            others,
        );
        if has.time {
            b.add(
                "indicator_drift",
                site,
                format!("indicator {} drifts with time", axis.name()),
                (2e-5 / 3600.0, 6e-5 / 3600.0),
                vec![(format!("indicator_drift_{}", axis.name()), at, Basis::new(Variable::Time, Shape::Linear), 0)],
            );
        }
    }
    for ball in 1..=b.model.cell.balls.len() {
        let parts = Axis::ALL
            .iter()
            .map(|a| (format!("ball_{ball}_{}", a.name()), Site::Ball { ball, axis: *a }, Basis::CONSTANT, 0))
            .collect();
        b.add(
            "ball_position",
            serde_json::json!({ "ball": ball }),
            format!("ball {ball} is not where the ballbar says"),
            (5e-5, 2e-4),
            parts,
        );
    }
}

fn late_reading(b: &mut Builder<'_>) {
    let lag = |joint| Basis::new(Variable::Lag { joint }, Shape::Linear);
    b.add(
        "late_joint_reading",
        serde_json::json!({ "joints": true }),
        "joints were read before the arm had settled: the error follows commanded minus read".into(),
        (0.7, 1.0),
        vec![("lag".into(), Site::AllJoints, lag(1), 1)],
    );
    for joint in 1..=b.dof() {
        b.add(
            "late_joint_reading",
            joint_site(joint),
            format!("joint {joint} was read before it had settled: the error follows commanded minus read"),
            (0.7, 1.0),
            vec![(format!("lag_{joint}"), Site::Joint { joint }, lag(joint), 1)],
        );
    }
}
