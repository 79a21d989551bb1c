//! Does a name explain what happens at its place, or only most of it? After everything that was found is modelled, each place
//! is asked once more by probes that know nothing of the catalogue: is a joint still off in a way that goes with an angle, with
//! time, with its load, with where it came from? What a probe finds there speaks against the name that was given.

use trical_ident::dataset::Dataset;
use trical_model::{Axis, Basis, Model, Motion, Place, Shape, Site, Term, Variable, trig};

use crate::candidate::{Candidate, Physical};
use crate::covariates::{is_order, name, order_of, value};
use crate::effect_id::{Cause, UNEXPLAINED};
use crate::linear::{Design, RegressionState};
use crate::locators::{knots, tents};
use crate::settings::{CONSIDERABLE_SHARE, HISTORY_KEPT, PROBE_KNOTS};
use crate::statistics::{bic_nats, f_test_of_probe, odds_outside_catalogue};

/// What the most telling probe of a place says.
#[derive(Clone, Debug)]
pub struct LackOfFit {
    /// Place.
    pub site: Place,
    /// On what the rest depends.
    pub variable: String,
    /// For which values of it.
    pub region: String,
    /// Probability of so strong a rest were there none, all probes of this place considered.
    pub p_value: f64,
    /// Sum of squares that the probe would still remove.
    pub dss: f64,
    /// Which probe.
    pub probe: usize,
}

/// Questions without names, and how the columns that they borrow are weighed (see [`Design::weighted`]).
pub struct Probes {
    /// As candidates.
    pub candidates: Vec<Candidate>,
    /// For each of them, for each of its columns, a factor for every observation.
    pub weights: Vec<Vec<Vec<f64>>>,
    /// For each of them, for which values of its variable a place would be off.
    pub regions: Vec<String>,
    /// For each of them, how many like it were looked at before it was taken.
    pub looked_at: Vec<f64>,
}

impl Probes {
    /// Adds a probe over one variable that is the most telling of so many like it.
    pub fn add_best(&mut self, of: f64, variable: String, region: String, best: Candidate) {
        self.candidates.push(Candidate { behaviour: variable, ..best });
        self.weights.push(Vec::new());
        self.regions.push(region);
        self.looked_at.push(of);
    }
}

/// A design with probes behind its candidates, at a state.
pub struct SpecificationTest<'a> {
    /// The design, probes last.
    pub design: &'a Design,
    /// The probes.
    pub probes: &'a Probes,
    /// Index of the first.
    pub first: usize,
    /// Share of the rows that is independent.
    pub temper: f64,
}

impl SpecificationTest<'_> {
    /// What a probe would still remove, and with how many numbers.
    fn gain(&self, state: &RegressionState, probe: usize) -> (f64, usize) {
        self.design.plain_gain(state, self.first + probe)
    }

    /// Independent scalars left at a state.
    #[must_use]
    pub fn freedom(&self, state: &RegressionState) -> f64 {
        self.design.rows as f64 * self.temper - state.parameters
    }

    fn lack_of_fit(&self, state: &RegressionState, probe: usize, gain: (f64, usize)) -> LackOfFit {
        let Candidate { site, behaviour, .. } = &self.probes.candidates[probe];
        LackOfFit {
            site: *site,
            variable: behaviour.clone(),
            region: self.probes.regions[probe].clone(),
            p_value: self.p_value(state, probe, gain),
            dss: gain.0,
            probe: self.first + probe,
        }
    }

    fn p_value(&self, state: &RegressionState, probe: usize, (dss, rank): (f64, usize)) -> f64 {
        (f_test_of_probe(state.ss, dss, rank, self.freedom(state)) * self.probes.looked_at[probe]).min(1.0)
    }

    /// The most telling probe of every place.
    #[must_use]
    pub fn places(&self, state: &RegressionState) -> Vec<LackOfFit> {
        let mut places: Vec<(LackOfFit, f64)> = Vec::new();
        for k in 0..self.probes.candidates.len() {
            let found = self.lack_of_fit(state, k, self.gain(state, k));
            match places.iter_mut().find(|m| m.0.site == found.site) {
                Some((best, asked)) => {
                    *asked += 1.0;
                    if found.p_value < best.p_value {
                        *best = found;
                    }
                }
                None => places.push((found, 1.0)),
            }
        }
        let corrected = |(m, asked): (LackOfFit, f64)| LackOfFit { p_value: (m.p_value * asked).min(1.0), ..m };
        places.into_iter().map(corrected).collect()
    }

    /// The probe of a place that says most at the price of its numbers (BIC), if any says anything, and by how many nats.
    #[must_use]
    pub fn best_probe(&self, state: &RegressionState, site: Place) -> Option<(LackOfFit, f64)> {
        let says = |(dss, rank): (f64, usize)| bic_nats(self.freedom(state), state.ss, state.ss - dss, rank as f64);
        let here = (0..self.probes.candidates.len()).filter(|k| self.probes.candidates[*k].site == site);
        let gains = here.map(|k| (k, self.gain(state, k)));
        let (probe, gain, nats) = gains
            .map(|(k, g)| (k, g, says(g) - libm::log(self.probes.looked_at[k])))
            .max_by(|a, b| a.2.total_cmp(&b.2))?;
        Some((self.lack_of_fit(state, probe, gain), nats))
    }

    /// What a probe of one scalar says of it: its least and its largest value and how far the joint is off there, deg. Nothing for
    /// probes of several.
    #[must_use]
    pub fn line(&self, state: &RegressionState, found: &LackOfFit) -> Vec<(f64, f64)> {
        let Some([scalar]) = self.probes.weights.get(found.probe - self.first).map(Vec::as_slice) else {
            return Vec::new();
        };
        let slope = self.design.coefficients(state, found.probe)[0];
        let ends = [scalar.iter().copied().fold(f64::MAX, f64::min), scalar.iter().copied().fold(f64::MIN, f64::max)];
        ends.map(|u| (u.to_degrees(), (slope * u).to_degrees())).into()
    }

    /// Probability that a name is wrong because its place does something else: a probe finds a rest (`state` has everything),
    /// the rest is considerable beside what the name explains (`own`), and without the name (`without`) the probe would explain
    /// much of the same.
    #[must_use]
    pub fn doubt(
        &self,
        state: &RegressionState,
        without: &RegressionState,
        own: f64,
        is_here: &dyn Fn(Place) -> bool,
    ) -> f64 {
        let here: Vec<usize> =
            (0..self.probes.candidates.len()).filter(|k| is_here(self.probes.candidates[*k].site)).collect();
        let asked = here.len() as f64;
        let mut most = 0.0_f64;
        for k in here {
            let left = self.gain(state, k);
            let odds = odds_outside_catalogue((self.p_value(state, k, left) * asked).min(1.0));
            let alone = self.gain(without, k).0;
            most = most.max(odds / (1.0 + odds) * doubt_by_rest(left.0, alone, own));
        }
        most
    }
}

/// How much a rest doubts a name that explains `own`: it is considerable beside that (`left`), and without the name the same thing would
/// explain much of what the name does (`alone`).
pub fn doubt_by_rest(left: f64, alone: f64, own: f64) -> f64 {
    let share = left / own.max(1e-300);
    let same = ((alone - left) / own.max(1e-300)).clamp(0.0, 1.0);
    share / (share + CONSIDERABLE_SHARE) * same
}

/// A joint's moves up to an observation, rad.
#[derive(Clone, Copy, Default)]
struct Moves {
    last: f64,
    before: f64,
    /// All of them, each counted for less than the one after it.
    fading: f64,
}

impl Moves {
    fn then(self, last: f64) -> Self {
        Self { last, before: self.last, fading: HISTORY_KEPT * self.fading + (1.0 - HISTORY_KEPT) * short(last) }
    }
}

/// Moves beyond half a radian count as one of that.
fn short(way: f64) -> f64 {
    way.clamp(-0.5, 0.5)
}

/// A scalar for every observation that no basis knows: of a joint's moves.
struct MoveHistory {
    name: &'static str,
    /// To what the joint is off in proportion.
    to: &'static str,
    of: fn(Moves) -> f64,
}

const MOVE_HISTORIES: [MoveHistory; 4] = [
    MoveHistory { name: "dir", to: "the last one", of: |m| short(m.last) },
    MoveHistory { name: "travel", to: "how far the last one went", of: |m| m.last.abs() },
    MoveHistory { name: "dir", to: "the one before the last", of: |m| short(m.before) },
    MoveHistory { name: "dir", to: "those before, fading", of: |m| m.fading },
];

/// What to ask every joint, the tool, the fixture and the links.
#[must_use]
pub fn probes(model: &Model, data: &Dataset) -> Probes {
    let mut probes: Vec<Candidate> = Vec::new();
    let order = order_of(data);
    let has_direction = data.observations.iter().all(|o| o.state.dir.is_some());
    let has_masses = model.robot.require_masses().is_ok();
    let n = model.robot.dof();
    for joint in 1..=n {
        let site = Place::Joint(joint);
        let at = Site::Joint { joint };
        let mut variables: Vec<Variable> = (1..=n).map(|joint| Variable::Joint { joint }).collect();
        variables.extend(order);
        for variable in variables {
            let Some(knots) = knots(&value_of(data, variable), PROBE_KNOTS) else { continue };
            probes.push(probe(site, name(variable), tents(at, variable, None, &knots)));
            if has_direction && (is_order(variable) || variable == (Variable::Joint { joint })) {
                let named = if is_order(variable) { name(variable) } else { format!("dir{joint}") };
                probes.push(probe(site, named, tents(at, variable, Some(joint), &knots)));
            }
        }
        if has_masses {
            let bases = [Shape::SignedSquare, Shape::Cube, Shape::SoftSign { scale: 0.3 }]
                .map(|shape| Basis::torque(joint, shape))
                .map(|basis| Term::new("probe", UNEXPLAINED, at, basis));
            probes.push(probe(site, format!("tau{joint}"), bases.to_vec()));
        }
    }
    if let Some(order) = order
        && let Some(knots) = knots(&value_of(data, order), PROBE_KNOTS)
    {
        let along = |of: fn(Motion) -> Site| {
            Axis::ALL.iter().flat_map(|a| tents(of(Motion::Along(*a)), order, None, &knots)).collect::<Vec<_>>()
        };
        probes.push(probe(Place::Tool, name(order), along(Site::Tool)));
        if data.observations.iter().any(|o| matches!(o.measured, trical_model::Measured::Touch { .. })) {
            probes.push(probe(Place::Fixture, name(order), along(Site::Fixture)));
        }
        let growth = tents(Site::Links, order, None, &knots);
        probes.push(probe(Place::Links, name(order), growth));
    }
    // what came before, and two angles at once, are no basis: such probes borrow a joint's constant column and weigh it row
    // by row
    let mut weights: Vec<Vec<Vec<f64>>> = vec![Vec::new(); probes.len()];
    let mut regions: Vec<String> = probes.iter().map(|p| format!("all of {}", p.behaviour)).collect();
    for joint in 1..=n {
        let constant = Term::new("probe", UNEXPLAINED, Site::Joint { joint }, Basis::CONSTANT);
        let site = Place::Joint(joint);
        for history in &MOVE_HISTORIES {
            probes.push(probe(site, format!("{}{joint}", history.name), vec![constant.clone()]));
            weights.push(vec![before(data, joint, history)]);
            regions.push(format!("all moves, in proportion to {}", history.to));
        }
        for other in (1..=n).filter(|k| *k != joint) {
            let product = |of: fn(f64, f64) -> f64| {
                data.observations.iter().map(|o| of(o.state.q[joint - 1], o.state.q[other - 1])).collect::<Vec<f64>>()
            };
            probes.push(probe(site, format!("q{other}"), vec![constant.clone(); 4]));
            regions.push(format!("all of q{other}, with q{joint}"));
            weights.push(vec![
                product(|a, b| trig::sin(a) * trig::sin(b)),
                product(|a, b| trig::sin(a) * trig::cos(b)),
                product(|a, b| trig::cos(a) * trig::sin(b)),
                product(|a, b| trig::cos(a) * trig::cos(b)),
            ]);
        }
    }
    let looked_at = vec![1.0; probes.len()];
    Probes { candidates: probes, weights, regions, looked_at }
}

fn value_of(data: &Dataset, variable: Variable) -> Vec<f64> {
    data.observations.iter().map(|o| value(variable, &o.state)).collect()
}

fn probe(site: Place, variable: String, terms: Vec<Term>) -> Candidate {
    Candidate {
        cause: Cause::Unexplained,
        site,
        behaviour: variable,
        signs: vec![0; terms.len()],
        physical: Physical::default(),
        scales: vec![1.0; terms.len()],
        terms,
        typical: 0.0,
        log_prior: 0.0,
    }
}

/// What a history says at every observation; moves that are not known (the first of a recording) count as none.
fn before(data: &Dataset, joint: usize, history: &MoveHistory) -> Vec<f64> {
    struct Last {
        recording: usize,
        pose: usize,
        q: f64,
        moves: Moves,
    }
    let mut last: Option<Last> = None;
    data.observations
        .iter()
        .map(|o| {
            let q = o.state.q[joint - 1];
            let moves = match &last {
                Some(l) if l.recording == o.recording && l.pose == o.pose => l.moves,
                Some(l) if l.recording == o.recording => l.moves.then(q - l.q),
                _ => Moves::default(),
            };
            last = Some(Last { recording: o.recording, pose: o.pose, q, moves });
            (history.of)(moves)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::linear::Fitted;
    use crate::test_data::{arm, states, touches};
    use trical_model::State;

    /// Joint 2 goes to these angles; two touches at each pose, in two recordings.
    fn moved() -> Dataset {
        let at = |angles: &[f64]| {
            let twice = angles.iter().enumerate().flat_map(|(k, q)| [(k, *q); 2]).enumerate();
            let touch = |(n, (_, q)): (usize, (usize, f64))| {
                (State::at(&[0.0, q, 0.3]), [1e-5 * f64::from(u8::try_from(n).unwrap()), 0.0, 0.0])
            };
            twice.map(touch).collect::<Vec<_>>()
        };
        touches(&[at(&[0.1, 0.3, -0.5]), at(&[1.0, 0.9])])
    }

    fn near(found: &[f64], expected: &[f64]) {
        assert!(
            found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12),
            "{found:?}"
        );
    }

    /// Nothing is known of the move to a recording's first pose; a second touch of a pose came by the same move as the first.
    #[test]
    fn what_a_joint_did_before_is_told_by_the_moves_within_a_recording() {
        let data = moved();
        let [last, travel, second, fading] = [0, 1, 2, 3].map(|k| before(&data, 2, &MOVE_HISTORIES[k]));
        near(&last, &[0.0, 0.0, 0.2, 0.2, -0.5, -0.5, 0.0, 0.0, -0.1, -0.1]);
        near(&travel, &[0.0, 0.0, 0.2, 0.2, 0.8, 0.8, 0.0, 0.0, 0.1, 0.1]);
        near(&second, &[0.0, 0.0, 0.0, 0.0, 0.2, 0.2, 0.0, 0.0, 0.0, 0.0]);
        let (first, then) = (0.2 * 0.2, 0.8 * 0.2 * 0.2 - 0.2 * 0.5);
        near(&fading, &[0.0, 0.0, first, first, then, then, 0.0, 0.0, -0.2 * 0.1, -0.2 * 0.1]);
        // and nothing of joints that stood still
        near(&before(&data, 3, &MOVE_HISTORIES[0]), &[0.0; 10]);
    }

    #[test]
    fn every_joint_is_asked_for_all_angles_and_a_probe_of_two_has_their_products() {
        let data =
            states(40, |k| State::at(&[(2.0 * k).sin(), (3.0 * k).cos(), 0.04 * k, k.sin(), k.cos(), (1.5 * k).sin()]));
        let asked = probes(&arm(), &data);
        assert!(asked.candidates.len() == asked.weights.len() && asked.weights.len() == asked.regions.len());
        for joint in 1..=6 {
            let here: Vec<usize> =
                (0..asked.candidates.len()).filter(|k| asked.candidates[*k].site == Place::Joint(joint)).collect();
            // curves over six angles and the order of the rows, one of its torque, four of its moves, five of two angles
            assert_eq!(here.len(), 7 + 1 + 4 + 5, "joint {joint}");
            for k in here.into_iter().filter(|k| asked.weights[*k].len() == 4) {
                let other: usize = asked.candidates[k].behaviour[1..].parse().unwrap();
                assert_eq!(asked.regions[k], format!("all of q{other}, with q{joint}"));
                for (n, o) in data.observations.iter().enumerate() {
                    let (a, b) = (o.state.q[joint - 1], o.state.q[other - 1]);
                    let [ss, sc, cs, cc] = [0, 1, 2, 3].map(|w| asked.weights[k][w][n]);
                    // together they are any product of waves: of the difference and of the sum of the angles
                    assert!((cc + ss - (a - b).cos()).abs() < 1e-12 && (sc - cs - (a - b).sin()).abs() < 1e-12);
                    assert!((cc - ss - (a + b).cos()).abs() < 1e-12 && (sc + cs - (a + b).sin()).abs() < 1e-12);
                }
            }
        }
    }

    /// The most telling probe of a place pays for all that were asked there.
    #[test]
    fn of_each_place_the_most_telling_probe_is_told_at_the_price_of_all_that_were_asked() {
        let mut truth = arm();
        let lost = Basis::new(Variable::Joint { joint: 4 }, Shape::Cube);
        truth.terms.push(Term { value: 4e-4, ..Term::new("lost", UNEXPLAINED, Site::Joint { joint: 2 }, lost) });
        let data = crate::test_data::touched(&truth, 60);
        let mut model = arm();
        let zero = |joint| Term::new(format!("zero_{joint}"), "geometry", Site::Joint { joint }, Basis::CONSTANT);
        model.terms.extend((1..=6).map(zero));
        let (mut probes, noise) = (probes(&model, &data), trical_ident::Noise::usual(1));
        let of_q4 = |c: &Candidate| c.site == Place::Joint(2) && c.behaviour == "q4";
        let strongest = probes.candidates.iter().position(of_q4).unwrap();
        let copy = probes.candidates[strongest].clone();
        probes.add_best(1e4, "q4".into(), "all of q4, again".into(), copy);
        let white = crate::correlated_noise::CorrelatedNoise::WHITE;
        let all = Fitted::all(&model);
        let design = Design::weighted(all, &probes.candidates, &probes.weights, &data, &noise, white).unwrap();
        let state = design.start();
        let test = SpecificationTest { design: &design, probes: &probes, first: 0, temper: 1.0 };
        assert!((test.freedom(&state) - (180.0 - state.parameters)).abs() < 1e-9);
        let p_value = |k| test.p_value(&state, k, test.gain(&state, k));
        let [once, of_many] = [strongest, probes.candidates.len() - 1].map(p_value);
        assert!(once > 0.0 && once < 1e-4 && (of_many / once - 1e4).abs() < 1e-3, "{once} {of_many}");
        for found in test.places(&state) {
            let here = (0..probes.candidates.len()).filter(|k| probes.candidates[*k].site == found.site);
            let p: Vec<(f64, usize)> = here.map(|k| (p_value(k), k)).collect();
            let least = p.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
            assert_eq!(found.probe, least.1, "{}", found.site);
            let asked = p.iter().map(|_| 1.0).sum::<f64>();
            assert!((found.p_value - (least.0 * asked).min(1.0)).abs() <= 1e-12 * found.p_value, "{}", found.site);
        }
        let (best, nats) = test.best_probe(&state, Place::Joint(2)).unwrap();
        assert!(best.region == "all of q4" && nats > 10.0, "{} {nats}", best.region);
    }
}
