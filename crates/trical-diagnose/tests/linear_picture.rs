//! The linear picture of a fit works on inner products, of the numbers that bases say wherever a column has the direction of its
//! site. What it says is compared with fits of all rows as they are.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_diagnose::candidate::Candidate;
use trical_diagnose::catalogue::catalogue;
use trical_diagnose::correlated_noise::CorrelatedNoise;
use trical_diagnose::covariates::Covariates;
use trical_diagnose::linear::{Design, Downdate, Fitted, Partition, RegressionState};
use trical_diagnose::locators::locators;
use trical_diagnose::selection::Search;
use trical_diagnose::{Cause, EffectId};
use trical_ident::dataset::Observation;
use trical_ident::fit::priors::PriorKnowledge;
use trical_ident::{Dataset, JointSource, Noise};
use trical_model::{
    Axis, Basis, Cell, Forward, Measured, Model, Motion, Place, Pose, Recording, Robot, Row, Shape, Site, State, Term,
    Tool, residual_rows,
};

const ROBOT: &str = include_str!("../../trical-model/tests/data/arm.toml");
const CELL: &str = include_str!("../../trical-model/tests/data/cell.toml");

/// An arm that gives way, 100 touches with noise, and all that can be tried on them.
fn made() -> (Model, Dataset, Vec<Candidate>) {
    let mut model = Model::nominal(Robot::parse(ROBOT, "arm.toml").unwrap(), Cell::parse(CELL, "cell.toml").unwrap());
    let mut term = |name: &str, site, basis, value| {
        model.terms.push(Term { value, ..Term::new(name, "made", site, basis) });
    };
    for (name, axis) in [("tool_x", Axis::X), ("tool_y", Axis::Y), ("tool_z", Axis::Z)] {
        term(name, Site::Tool(Motion::Along(axis)), Basis::CONSTANT, 1e-4);
    }
    for joint in 2..=5 {
        term(&format!("zero_{joint}"), Site::Joint { joint }, Basis::CONSTANT, 1e-4);
    }
    for joint in 2..=3 {
        term(&format!("soft_{joint}"), Site::Joint { joint }, Basis::torque(joint, Shape::Linear), 2e-5);
    }
    let mut rng = Pcg64Mcg::seed_from_u64(11);
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let mut t = 0.0;
    let rows = (0..100)
        .map(|k| {
            let q: [f64; 6] = std::array::from_fn(|_| rng.random_range(-1.2..1.2));
            t += 20.0;
            let dir = Some(std::array::from_fn(|_| if rng.random_range(0.0..1.0) < 0.5 { -1 } else { 1 }));
            let temp_c = Some(20.0 + 5.0 * rng.random_range(0.0..1.0));
            let state = State { t: Some(t), dir, temp_c, ..State::at(&q) };
            let pose = forward.world_from_tool(&state, &mut ws);
            let i = pose.rotation.transpose() * (model.cell.balls[k % 3] - pose.translation);
            let reading = std::array::from_fn(|a| i[a] + 3e-5 * rng.random_range(-1.0..1.0));
            Row { state, measured: Measured::Touch { ball: k % 3, reading }, seq: None, line: k + 2 }
        })
        .collect();
    let recording = Recording { name: "made".into(), joints: 6, rows, ..Recording::default() };
    let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
    let recorded = Covariates::new(&model, &data, 1e-5);
    let mut candidates = catalogue(&recorded, &[]).0;
    candidates.extend(locators(&model, &data));
    (model, data, candidates)
}

/// The same arm, with three targets on the tool that a tracker sees at every pose.
fn seen_by_a_tracker() -> (Model, Dataset, Vec<Candidate>) {
    let (mut model, mut data, _) = made();
    model.frames = vec![Pose::identity()];
    model.cell.tool.targets = [[0.1, 0.0, 0.1], [-0.05, 0.08, 0.1], [-0.05, -0.08, 0.2]].map(Into::into).into();
    // the device's place on the flange is that of its targets, which are known
    model.terms.retain(|t| !matches!(t.site, Site::Tool(_)));
    let forward = Forward::new(Model { terms: Vec::new(), ..model.clone() }, Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let mut rng = Pcg64Mcg::seed_from_u64(12);
    let mut seen = |o: &Observation| {
        let tool = forward.world_from_tool(&o.state, &mut ws);
        let Tool { tcp, targets, .. } = &model.cell.tool;
        let at = targets.iter().map(|target| tool.rotation * (target - tcp) + tool.translation);
        let mut noisy = |v: f64| v + 3e-5 * rng.random_range(-1.0..1.0);
        let point = |(target, at): (usize, nalgebra::Vector3<f64>)| Measured::Point {
            target,
            position: [noisy(at.x), noisy(at.y), noisy(at.z)],
        };
        let points: Vec<Measured> = at.enumerate().map(point).collect();
        points.into_iter().map(|measured| Observation { measured, ..*o }).collect::<Vec<_>>()
    };
    data.observations = data.observations.iter().flat_map(&mut seen).collect();
    let candidates = catalogue(&Covariates::new(&model, &data, 1e-5), &[]).0;
    (model, data, candidates)
}

/// Weighted rows of the model's parameters and of the terms of some candidates, and the residual.
fn rows(model: &Model, set: &[&Candidate], data: &Dataset) -> (DMatrix<f64>, DVector<f64>) {
    let noise = Noise::usual(1);
    let mut wide = model.clone();
    wide.terms.extend(set.iter().flat_map(|c| c.terms.iter().cloned()));
    let p = wide.terms.len();
    let forward = Forward::new(wide, (0..p).collect()).unwrap();
    let mut ws = forward.workspace();
    let mut block = vec![0.0; 6 * p];
    let (mut all, mut residual) = (Vec::new(), Vec::new());
    for o in &data.observations {
        let n = forward.linearize(&o.state, &o.measured, o.frame, &mut ws, &mut block);
        assert_eq!(n, residual_rows(&o.measured));
        for k in 0..n {
            let s = 1.0 / noise.sigma(0, &o.measured, k);
            all.extend(block[k * p..(k + 1) * p].iter().map(|v| v * s));
            residual.push(ws.residual()[k] * s);
        }
    }
    (DMatrix::from_row_slice(residual.len(), p, &all), DVector::from_vec(residual))
}

/// Least sum of squares of the residual and of the candidates' coefficients in units of their prior, and the coefficients of all.
fn fitted(model: &Model, set: &[&Candidate], data: &Dataset) -> (f64, DVector<f64>) {
    least(rows(model, set, data), set)
}

/// As [`fitted`], for rows as given.
fn least((j, r): (DMatrix<f64>, DVector<f64>), set: &[&Candidate]) -> (f64, DVector<f64>) {
    let (n, p) = j.shape();
    let priors: Vec<f64> = set.iter().flat_map(|c| c.scales.iter().map(|s| 1.0 / s)).collect();
    let mut stacked = DMatrix::zeros(n + priors.len(), p);
    stacked.rows_mut(0, n).copy_from(&j);
    for (k, v) in priors.iter().enumerate() {
        stacked[(n + k, p - priors.len() + k)] = *v;
    }
    let mut right = DVector::zeros(n + priors.len());
    right.rows_mut(0, n).copy_from(&r);
    // columns of one length each, or the smallest would be lost beside the largest
    let lengths: Vec<f64> = stacked.column_iter().map(|c| c.norm().max(1e-300)).collect();
    for (k, length) in lengths.iter().enumerate() {
        stacked.column_mut(k).scale_mut(1.0 / length);
    }
    let mut x = -stacked.clone().svd(true, true).solve(&right, 1e-12).unwrap();
    let left = (&stacked * &x + right).norm_squared();
    for (v, length) in x.iter_mut().zip(&lengths) {
        *v /= length;
    }
    (left, x)
}

/// One candidate of every effect, with a second one of those that have many.
fn some(candidates: &[Candidate]) -> Vec<usize> {
    let mut causes: Vec<Cause> = candidates.iter().map(|c| c.cause).collect();
    causes.dedup();
    causes
        .iter()
        .flat_map(|e| {
            let own: Vec<usize> = (0..candidates.len()).filter(|k| candidates[*k].cause == *e).collect();
            [own[own.len() / 3], own[own.len() - 1]]
        })
        .collect()
}

fn near(a: f64, b: f64, scale: f64) -> bool {
    (a - b).abs() <= 1e-8 * scale
}

#[test]
fn a_candidate_removes_what_a_fit_of_all_rows_with_it_removes() {
    removes_what_a_fit_removes(made());
}

#[test]
fn a_candidate_removes_the_same_where_several_targets_are_seen_at_a_pose() {
    removes_what_a_fit_removes(seen_by_a_tracker());
}

fn removes_what_a_fit_removes((model, data, candidates): (Model, Dataset, Vec<Candidate>)) {
    let design = Design::new(&model, &candidates, &data, &Noise::usual(1)).unwrap();
    let start = design.start();
    let (before, _) = fitted(&model, &[], &data);
    assert!(near(start.ss, before, before), "{} {before}", start.ss);
    for k in some(&candidates) {
        let (after, x) = fitted(&model, &[&candidates[k]], &data);
        let told = design.gain(&start, k).dss;
        let name = candidates[k].located();
        // what is all but absorbed by the fit counts as nothing
        assert!((before - after - told).abs() < 1e-6 * before, "{name}: {} {told}", before - after);
        let own = x.rows(model.terms.len(), candidates[k].terms.len());
        if candidates[k].terms.len() == 1 && told > 1e-3 {
            assert!((design.coefficients(&start, k)[0] - own[0]).abs() < 1e-6 * own[0].abs(), "{name}");
        }
    }
}

#[test]
fn candidates_together_remove_what_a_fit_of_all_rows_with_them_removes() {
    for (model, data, candidates) in [made(), seen_by_a_tracker()] {
        let design = Design::new(&model, &candidates, &data, &Noise::usual(1)).unwrap();
        let set: Vec<usize> = some(&candidates).into_iter().step_by(5).collect();
        let mut state = design.start();
        set.iter().for_each(|k| design.add(&mut state, *k));
        let (after, _) = fitted(&model, &set.iter().map(|k| &candidates[*k]).collect::<Vec<_>>(), &data);
        assert!((state.ss - after).abs() < 1e-6 * after, "{} {after}", state.ss);
    }
}

/// What every candidate would do at two stages is the same.
fn same(design: &Design, count: usize, [a, b]: [&RegressionState; 2]) {
    assert!(near(a.ss, b.ss, a.ss) && near(a.parameters, b.parameters, 1.0), "{} {}", a.parameters, b.parameters);
    for k in 0..count {
        let [a, b] = [a, b].map(|state| design.gain(state, k));
        assert!(near(a.dss, b.dss, a.dss.max(1.0)) && near(a.occam, b.occam, 1.0), "{k}: {a:?} {b:?}");
        assert!(near(a.rank, b.rank, 1.0), "{k}: {a:?} {b:?}");
    }
}

#[test]
fn a_set_added_at_once_is_its_members_added_one_after_the_other() {
    let (model, data, mut candidates) = made();
    // a twin adds nothing
    let first = some(&candidates)[1];
    candidates.push(candidates[first].clone());
    let columns = |set: &[usize]| set.iter().map(|c| candidates[*c].terms.len()).sum::<usize>();
    let all: Vec<usize> = (0..candidates.len()).collect();
    let design = Design::new(&model, &candidates, &data, &Noise::usual(1)).unwrap();
    for members in [3, 8, 20] {
        let mut set: Vec<usize> = some(&candidates).into_iter().skip(1).step_by(2).take(members).collect();
        set.insert(2, candidates.len() - 1);
        assert!(4 * columns(&set) <= columns(&all), "much wider than the set");
        let mut beside = design.start();
        some(&candidates).into_iter().step_by(2).take(8).for_each(|c| design.add(&mut beside, c));
        for start in [design.start(), beside] {
            let mut one_by_one = start.clone();
            set.iter().for_each(|c| design.add(&mut one_by_one, *c));
            same(&design, candidates.len(), [&design.with(&start, &set), &one_by_one]);
        }
    }
}

#[test]
fn a_set_without_some_of_its_members_is_the_others_added_anew() {
    let (model, data, mut candidates) = made();
    let mut set: Vec<usize> = some(&candidates).into_iter().step_by(4).collect();
    let design = |candidates: &[Candidate]| Design::new(&model, candidates, &data, &Noise::usual(1)).unwrap();
    let check = |design: &Design, candidates: &[Candidate], set: &[usize], out: &[usize]| {
        let search = Search::new(design, candidates, 1.0);
        let start = design.start();
        let mut downdate = Downdate::new(design, &start, set);
        let rest: Vec<usize> = set.iter().copied().filter(|c| !out.contains(c)).collect();
        let without = search.without(&downdate, &start, out);
        same(design, candidates.len(), [&without.state, &search.with(&start, &rest)]);
        // and a candidate on top of that, made ready or not
        let anew: Vec<usize> = rest.iter().copied().chain([7]).collect();
        let anew = search.with(&start, &anew);
        same(design, candidates.len(), [&downdate.with(&without, 7), &anew]);
        downdate.prepare(&[7, 8]);
        same(design, candidates.len(), [&downdate.with(&without, 7), &anew]);
    };
    let plain = design(&candidates);
    for k in 0..set.len() {
        check(&plain, &candidates, &set, &set[k..(k + 2).min(set.len())]);
    }
    // a twin absorbs its twin: the one left out, the other has to be added after all
    candidates.push(candidates[set[0]].clone());
    set.push(candidates.len() - 1);
    let twins = design(&candidates);
    check(&twins, &candidates, &set, &set[..1]);
    check(&twins, &candidates, &set, &set[set.len() - 1..]);
}

/// A heavy load moves the pose at which gravity's torque changes its sign: the picture of a gap must know the load that was found.
#[test]
fn effects_that_were_fitted_are_taken_out_where_they_were_fitted() {
    let (model, data, candidates) = made();
    let gap = |c: &&Candidate| c.cause == EffectId::LostMotionGravity.into() && c.site == Place::Joint(3);
    let set = [candidates.iter().find(|c| c.cause == EffectId::Payload.into()), candidates.iter().find(gap)]
        .map(Option::unwrap);
    let both: Vec<Candidate> = set.iter().map(|c| (*c).clone()).collect();
    let values = [2.0, 0.05, -0.02, 0.03, 3e-4];
    let mut with = model.clone();
    let terms = both.iter().flat_map(|c| &c.terms).zip(values);
    with.terms.extend(terms.map(|(t, value)| Term { value, ..t.clone() }));
    let p = model.terms.len();
    let design = Design::weighted(
        Fitted { parameters: p, effects: p, ..Fitted::all(&with) },
        &both,
        &[],
        &data,
        &Noise::usual(1),
        CorrelatedNoise::WHITE,
    )
    .unwrap();

    // the same by hand: rows of the whole model, without the part that its effects have in them by their columns
    let (j, r) = rows(&with, &[], &data);
    let left = &r - j.columns(p, values.len()) * DVector::from_row_slice(&values);
    let (expected, x) = least((j.clone(), left), &set);
    let start = design.start();
    let mut state = start.clone();
    design.add(&mut state, 0);
    let last = design.coefficients(&state, 1)[0];
    design.add(&mut state, 1);
    assert!(near(state.ss, expected, start.ss), "{} {expected}", state.ss);
    assert!((last - x[x.len() - 1]).abs() < 1e-8 * last.abs(), "{last} {}", x[x.len() - 1]);

    // without the load the gap would be sought elsewhere
    let (bare, _) = rows(&model, &set, &data);
    let gap = |j: &DMatrix<f64>| j.column(j.ncols() - 1).into_owned();
    assert!((gap(&j) - gap(&bare)).norm() > 0.02 * gap(&bare).norm());
}

#[test]
fn a_column_weighed_row_by_row_is_the_column_that_says_so_itself() {
    for (model, data, candidates) in [made(), seen_by_a_tracker()] {
        let wave =
            candidates.iter().find(|c| c.cause == EffectId::JointHarmonic.into() && c.site == Place::Joint(1)).unwrap();
        let constant = |t: &Term| Term { basis: Basis::CONSTANT, ..t.clone() };
        let weighed = Candidate { terms: wave.terms.iter().map(constant).collect(), ..wave.clone() };
        let weights: Vec<Vec<f64>> = wave
            .terms
            .iter()
            .map(|t| data.observations.iter().map(|o| t.basis.shape.at(o.state.q[0]).0).collect())
            .collect();
        let both = [wave.clone(), weighed];
        let design = Design::weighted(
            Fitted::all(&model),
            &both,
            &[Vec::new(), weights],
            &data,
            &Noise::usual(1),
            CorrelatedNoise::WHITE,
        )
        .unwrap();
        let [a, b] = [0, 1].map(|k| design.gain(&design.start(), k));
        assert!(near(a.dss, b.dss, a.dss) && near(a.rank, b.rank, 1.0), "{a:?} {b:?}");
    }
}

#[test]
fn held_out_errors_are_those_of_a_fit_without_their_rows_however_the_set_is_reached() {
    let (model, data, candidates) = made();
    let design = || Design::new(&model, &candidates, &data, &Noise::usual(1)).unwrap();
    let set: Vec<usize> = some(&candidates).into_iter().step_by(9).collect();
    let poses = data.used_poses();
    let seen = |p: usize| poses.binary_search(&p).unwrap() % 4 != 0;
    let design = design();
    let partition = |set: &[usize]| Partition::new(&design, set, 2, &|p| usize::from(seen(p))).unwrap();
    let errors = |p: &Partition<'_>, out: &[usize], add| p.position_errors(&p.instead(out, add), Some(0));
    let told = errors(&partition(&set), &[], None);
    assert_eq!(told.len(), data.observations.iter().filter(|o| !seen(o.pose)).count());
    // a set reached by taking out and putting in is the set
    let (first, rest) = (set[0], &set[1..]);
    for (a, b) in told.iter().zip(errors(&partition(rest), &[], Some(first))) {
        assert!(near(*a, b, 1e-4), "{a} {b}");
    }
    let without = errors(&partition(rest), &[], None);
    for (a, b) in without.iter().zip(errors(&partition(&set), &[first], None)) {
        assert!(near(*a, b, 1e-4), "{a} {b}");
    }
    let other = (0..candidates.len()).find(|c| !set.contains(c) && candidates[*c].terms.len() > 1).unwrap();
    let exchanged: Vec<usize> = rest.iter().copied().chain([other]).collect();
    for (a, b) in errors(&partition(&exchanged), &[], None).iter().zip(errors(&partition(&set), &[first], Some(other)))
    {
        assert!(near(*a, b, 1e-4), "{a} {b}");
    }

    let chosen: Vec<&Candidate> = set.iter().map(|k| &candidates[*k]).collect();
    let few =
        Dataset { observations: data.observations.iter().filter(|o| seen(o.pose)).cloned().collect(), ..data.clone() };
    let (_, x) = fitted(&model, &chosen, &few);
    let (j, r) = rows(&model, &chosen, &data);
    let left = (j * x + r) * 1e-5;
    let expected: Vec<f64> = data
        .observations
        .iter()
        .enumerate()
        .filter(|(_, o)| !seen(o.pose))
        .map(|(k, _)| left.rows(3 * k, 3).norm())
        .collect();
    for (a, b) in told.iter().zip(&expected) {
        assert!((a - b).abs() < 1e-4 * b.max(1e-5), "{a} {b}");
    }
}

/// Squared length of what is left at the touches `block` by a fit to the touches `seen`, in the covariance `I + X H^-1 X'` with which that fit
/// predicts them, and the logarithm of its determinant.
fn foreseen(model: &Model, set: &[&Candidate], data: &Dataset, seen: &[usize], block: &[usize]) -> (f64, f64) {
    let (j, r) = rows(model, set, data);
    let of = |touches: &[usize]| touches.iter().flat_map(|k| 3 * k..3 * k + 3).collect::<Vec<usize>>();
    let (fit, told) = (of(seen), of(block));
    let mut x = j.clone();
    let lengths: Vec<f64> = j.column_iter().map(|c| c.norm().max(1e-300)).collect();
    lengths.iter().enumerate().for_each(|(k, length)| x.column_mut(k).scale_mut(1.0 / length));
    let (some, x) = (x.select_rows(&fit), x.select_rows(&told));
    let mut h = some.transpose() * &some;
    let priors: Vec<f64> = set.iter().flat_map(|c| c.scales.iter().map(|s| 1.0 / s)).collect();
    let first = lengths.len() - priors.len();
    for (k, v) in priors.iter().enumerate() {
        h[(first + k, first + k)] += (v / lengths[first + k]).powi(2);
    }
    let h = h.cholesky().unwrap();
    let left = r.select_rows(&told) - &x * h.solve(&(some.transpose() * r.select_rows(&fit)));
    let covariance = DMatrix::identity(told.len(), told.len()) + &x * h.solve(&x.transpose());
    let root = covariance.cholesky().unwrap();
    (left.dot(&root.solve(&left)), 2.0 * root.l().diagonal().map(f64::ln).sum())
}

#[test]
fn unseen_blocks_are_foreseen_with_the_covariance_of_a_fit_without_them_however_the_set_is_reached() {
    let (model, data, candidates) = made();
    let design = Design::new(&model, &candidates, &data, &Noise::usual(1)).unwrap();
    let set: Vec<usize> = some(&candidates).into_iter().step_by(9).collect();
    let partition = Partition::new(&design, &set, 2, &|p| p / 10 % 2).unwrap();
    let predictive = partition.predictive(10, &|p| Some(p / 10)).unwrap();
    let other = (0..candidates.len()).find(|c| !set.contains(c) && candidates[*c].terms.len() > 1).unwrap();
    let most = &set[1..];
    let sets: [(&[usize], Option<usize>); 5] =
        [(&[], None), (&set[..1], None), (&set[..1], Some(other)), (&[], Some(other)), (most, None)];
    for (out, add) in sets {
        let left: Vec<usize> = set.iter().copied().filter(|c| !out.contains(c)).chain(add).collect();
        let members: Vec<&Candidate> = left.iter().map(|k| &candidates[*k]).collect();
        for (block, told) in predictive.of_blocks(&partition, out, &[add])[0].as_ref().unwrap().iter().enumerate() {
            let touches = |wanted: &dyn Fn(usize) -> bool| -> Vec<usize> {
                (0..data.observations.len()).filter(|k| wanted(data.observations[*k].pose / 10)).collect()
            };
            let (seen, here) = (touches(&|b| b % 2 != block % 2), touches(&|b| b == block));
            let (square, log) = foreseen(&model, &members, &data, &seen, &here);
            assert!((told.square - square).abs() < 1e-5 * square, "{} {square}", told.square);
            assert!((told.log_covariance - log).abs() < 1e-5 * log.max(1.0), "{} {log}", told.log_covariance);
        }
    }
}

/// A candidate's coefficient has a prior about zero too: what is known of a parameter is the same, said in another place.
#[test]
fn what_is_known_of_a_parameter_weighs_as_the_prior_of_a_candidate_does() {
    let (mut model, data, candidates) = made();
    let sd = 3e-5;
    let own = model.terms.remove(3);
    let none = Term { value: 0.0, ..own.clone() };
    let candidate = Candidate { terms: vec![none], scales: vec![sd], signs: vec![0], ..candidates[0].clone() };
    model.terms.push(own);
    let p = model.terms.len();
    let known: Vec<PriorKnowledge> =
        (1..p).map(|_| PriorKnowledge::NOTHING).chain([PriorKnowledge::about_zero(sd)]).collect();
    let others: Vec<Candidate> = some(&candidates).into_iter().step_by(5).map(|k| candidates[k].clone()).collect();
    let design = |fitted: Fitted<'_>, candidates: &[Candidate]| {
        Design::weighted(fitted, candidates, &[], &data, &Noise::usual(1), CorrelatedNoise::WHITE).unwrap()
    };
    let all = Fitted::all(&model);
    let inside = design(Fitted { known: &known, ..all }, &others);
    let with_candidate = [std::slice::from_ref(&candidate), &others[..]].concat();
    let beside = design(Fitted { parameters: p - 1, effects: p - 1, ..all }, &with_candidate);

    let (a, mut b) = (inside.start(), beside.start());
    beside.add(&mut b, 0);
    assert!(near(a.ss, b.ss, b.ss), "{} {}", a.ss, b.ss);
    let p = p as f64;
    assert!((a.parameters - b.parameters).abs() < 1e-8 && a.parameters < p - 0.05, "{}", a.parameters);
    for (k, c) in others.iter().enumerate() {
        let [one, other] = [inside.gain(&a, k), beside.gain(&b, k + 1)];
        assert!((one.dss - other.dss).abs() < 1e-6 * b.ss, "{}: {} {}", c.located(), one.dss, other.dss);
    }
    let part_of = |pose: usize| pose % 4;
    let [one, other] = [
        Partition::new(&inside, &[0], 4, &part_of).unwrap().instead(&[], None),
        Partition::new(&beside, &[0, 1], 4, &part_of).unwrap().instead(&[], None),
    ];
    assert!(one.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-5 * b.abs().max(1.0)));
}

#[test]
fn a_fit_in_parts_with_other_priors_is_that_of_candidates_of_other_sizes() {
    let (model, data, mut candidates) = made();
    let set: Vec<usize> = some(&candidates).into_iter().step_by(9).collect();
    let part_of = |pose: usize| pose % 4;
    let design = |candidates: &[Candidate]| Design::new(&model, candidates, &data, &Noise::usual(1)).unwrap();
    let left = |design: &Design| Partition::new(design, &set, 4, &part_of).unwrap().instead(&[], None);
    let usual = design(&candidates);
    let unfitted = Partition::unfitted(&usual, &set, 4, &part_of).unwrap();
    let smaller = |share: f64| unfitted.with_priors(&|c| if c == set[0] { share } else { 1.0 });
    let near_all = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6 * b.abs().max(1.0));
    let same = left(&usual);
    assert!(near_all(&smaller(1.0), &same));
    candidates[set[0]].scales.iter_mut().for_each(|s| *s *= 1e-4);
    let other = left(&design(&candidates));
    assert!(near_all(&smaller(1e-4), &other) && !near_all(&same, &other));
}

/// The same by the whole covariance matrix of all touches, in the device's axes.
#[test]
fn noise_that_remembers_itself_is_weighed_by_its_covariance() {
    let (model, data, candidates) = made();
    let correlation = CorrelatedNoise { kept: 0.7, white: 0.3 };
    let n = data.observations.len();
    let covariance = DMatrix::from_fn(n, n, |i, j| {
        let apart = i32::try_from(i.abs_diff(j)).unwrap();
        if apart == 0 { 1.0 } else { 0.7 * 0.7_f64.powi(apart) }
    });
    let root = covariance.cholesky().unwrap().l();
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let turns: Vec<_> =
        data.observations.iter().map(|o| forward.world_from_tool(&o.state, &mut ws).rotation.transpose()).collect();
    let whitened = |set: &[&Candidate]| {
        let (j, r) = rows(&model, set, &data);
        let p = j.ncols();
        let mut all = j.insert_column(p, 0.0);
        all.set_column(p, &r);
        for (k, turn) in turns.iter().enumerate() {
            let turned = turn * all.fixed_rows::<3>(3 * k);
            all.fixed_rows_mut::<3>(3 * k).copy_from(&turned);
        }
        for axis in 0..3 {
            let own = DMatrix::from_fn(n, p + 1, |i, c| all[(3 * i + axis, c)]);
            let white = root.solve_lower_triangular(&own).unwrap();
            (0..n).for_each(|i| all.row_mut(3 * i + axis).copy_from(&white.row(i)));
        }
        (all.columns(0, p).into_owned(), all.column(p).into_owned())
    };
    let design = Design::weighted(Fitted::all(&model), &candidates, &[], &data, &Noise::usual(1), correlation).unwrap();
    let start = design.start();
    let (before, _) = least(whitened(&[]), &[]);
    assert!(near(start.ss, before, before), "{} {before}", start.ss);
    for k in some(&candidates).into_iter().step_by(3) {
        let set = [&candidates[k]];
        let (after, _) = least(whitened(&set), &set);
        let told = design.gain(&start, k).dss;
        assert!((before - after - told).abs() < 1e-6 * before, "{}: {} {told}", set[0].located(), before - after);
    }
}

/// Errors are those of the measurements, however they are weighed in the search.
#[test]
fn held_out_errors_do_not_go_with_the_memory_of_the_noise() {
    let (model, data, candidates) = made();
    let set: Vec<usize> = some(&candidates).into_iter().step_by(9).collect();
    let told = [CorrelatedNoise::WHITE, CorrelatedNoise { kept: 0.8, white: 0.25 }].map(|correlation| {
        let design =
            Design::weighted(Fitted::all(&model), &candidates, &[], &data, &Noise::usual(1), correlation).unwrap();
        let partition = Partition::new(&design, &set, 4, &|p| p % 4).unwrap();
        partition.position_errors(&partition.instead(&[], None), Some(0))
    });
    assert!(!told[0].is_empty() && told[0].len() == told[1].len());
    assert!(told[0].iter().zip(&told[1]).all(|(a, b)| near(*a, *b, 1e-4)));
}

/// What is made part of the fit costs nothing more, and leaves of all others what it leaves when it is added.
#[test]
fn candidates_beside_what_the_fit_has_absorbed_are_as_beside_what_was_added() {
    let (model, data, candidates) = made();
    let design = Design::new(&model, &candidates, &data, &Noise::usual(1)).unwrap();
    let search = Search::new(&design, &candidates, 1.0);
    let set = some(&candidates);
    let (first, then) = (&set[..3], set[4]);
    let added = search.with(&design.start(), first);
    let beside = design.absorbing(&added);
    let absorbed = beside.start();
    assert!(near(absorbed.ss, added.ss, added.ss) && near(absorbed.parameters, added.parameters, 1.0));
    let (mut one, mut other) = (added.clone(), absorbed.clone());
    design.add(&mut one, then);
    beside.add(&mut other, then);
    for (a, b) in [(&added, &absorbed), (&one, &other)] {
        for k in set.iter().filter(|k| !first.contains(k) && **k != then) {
            let (x, y) = (design.gain(a, *k), beside.gain(b, *k));
            let as_near = near(x.dss, y.dss, a.ss) && near(x.rank, y.rank, 1.0) && near(x.occam, y.occam, 1.0);
            assert!(as_near, "{}: {x:?} {y:?}", candidates[*k].cause.name());
        }
    }
}
