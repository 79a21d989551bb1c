//! The forward function and its Jacobians against a second, naive implementation on dual numbers: homogeneous matrices
//! multiplied one by one, gravity moments summed body by body.

use nalgebra::Vector3;
use num_dual::{Dual64, DualNum};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use trical_model::pose::{quaternion_from_rotation, rotation_zyx};
use trical_model::{
    Axis, Basis, Beside, Cell, Forward, GRAVITY, Joint, JointKind, Measured, Model, Motion, Parameter, Payload, Pose,
    Robot, Shape, Site, State, Term, Tool, Variable, residual_rows,
};

type D = Dual64;
type V = [D; 3];
type M = [[D; 3]; 3];
/// A pose, what was measured there, and the gravity moments.
type At<'a> = (&'a State, &'a Measured, &'a dyn Fn(usize, Axis, bool) -> D);

fn c(x: f64) -> D {
    D::from_re(x)
}
fn vec(v: &Vector3<f64>) -> V {
    [c(v.x), c(v.y), c(v.z)]
}
fn plus(a: V, b: V) -> V {
    std::array::from_fn(|i| a[i] + b[i])
}
fn minus(a: V, b: V) -> V {
    std::array::from_fn(|i| a[i] - b[i])
}
fn scale(a: V, s: D) -> V {
    a.map(|x| x * s)
}
fn dot(a: V, b: V) -> D {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
fn mul(a: &M, b: &M) -> M {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j]))
}
fn times(a: &M, v: V) -> V {
    std::array::from_fn(|i| dot(a[i], v))
}
fn transpose(a: &M) -> M {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}
fn col(a: &M, k: usize) -> V {
    [a[0][k], a[1][k], a[2][k]]
}
fn mat(r: &nalgebra::Matrix3<f64>) -> M {
    std::array::from_fn(|i| std::array::from_fn(|j| c(r[(i, j)])))
}
fn rot(axis: usize, t: D) -> M {
    let (s, co, o, z) = (t.sin(), t.cos(), c(1.0), c(0.0));
    match axis {
        0 => [[o, z, z], [z, co, -s], [z, s, co]],
        1 => [[co, z, s], [z, o, z], [-s, z, co]],
        _ => [[co, -s, z], [s, co, z], [z, z, o]],
    }
}
fn zyx(v: &[D; 6]) -> M {
    mul(&mul(&rot(2, v[5]), &rot(1, v[4])), &rot(0, v[3]))
}
fn log(r: &M) -> V {
    let v = scale([r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]], c(0.5));
    let s = (dot(v, v)).sqrt();
    let angle = s.atan2((r[0][0] + r[1][1] + r[2][2] - 1.0) * 0.5);
    scale(v, angle / s)
}

fn shape(s: Shape, u: D) -> D {
    match s {
        Shape::One => c(1.0),
        Shape::Linear => u,
        Shape::Absolute => u * u.re.signum(),
        Shape::SignedSquare => u * u * u.re.signum(),
        Shape::Cube => u * u * u,
        Shape::SoftSign { scale } => (u / scale).tanh(),
        Shape::Clip { at } => {
            if u.re.abs() < at {
                u / at
            } else {
                c(u.re.signum())
            }
        }
        Shape::Sine { cycles } => (u * cycles).sin(),
        Shape::Cosine { cycles } => (u * cycles).cos(),
        Shape::Step { at } => c(if u.re >= at { 1.0 } else { 0.0 }),
        Shape::Hinge { at } => {
            if u.re > at {
                u - at
            } else {
                c(0.0)
            }
        }
        Shape::WarmUp { constant } => c(1.0) - (-u / constant).exp(),
        Shape::Tent { left, centre, right } => {
            if u.re <= left || u.re >= right {
                c(0.0)
            } else if u.re <= centre {
                (u - left) / (centre - left)
            } else {
                (c(right) - u) / (right - centre)
            }
        }
        Shape::Growth { from, to } => {
            let beyond = (u - from) / (to - from);
            match beyond.re {
                part if part <= 0.0 || part >= 2.0 => c(0.0),
                part if part <= 1.0 => beyond * beyond,
                _ => c(2.0) - beyond,
            }
        }
    }
}

type JointFrames = (M, V, V, M);

/// Whether a term at a site across a joint acts about its foot.
fn foot(t: &Term) -> bool {
    matches!(t.basis.of, Variable::FootMoment { .. })
}

/// For one about a point between: the share of the way from the origin to the foot.
fn part(t: &Term) -> Option<f64> {
    match t.basis.of {
        Variable::PartMoment { share, .. } => Some(share),
        _ => None,
    }
}

struct Naive<'a> {
    model: &'a Model,
    values: Vec<D>,
    q: Vec<D>,
}

impl Naive<'_> {
    /// Sum over terms at `site(term) == wanted`, constant ones only or all.
    fn sum(&self, wanted: Site, with: Option<At<'_>>) -> D {
        let mut total = c(0.0);
        for (t, v) in self.model.terms.iter().zip(&self.values) {
            let direct = t.site == wanted;
            let joint_of = |site: Site| match site {
                Site::Joint { joint } => Some(joint),
                _ => None,
            };
            let (hit, of, sense, weight) = match t.site {
                Site::AllJoints => match joint_of(wanted) {
                    Some(j) => {
                        let of = match t.basis.of {
                            Variable::Lag { .. } => Variable::Lag { joint: j },
                            other => other,
                        };
                        (true, of, t.basis.sense.map(|_| j), 1.0)
                    }
                    None => (false, t.basis.of, None, 0.0),
                },
                Site::Links => match wanted {
                    Site::Link { link, parameter: Parameter::A } => {
                        (true, t.basis.of, t.basis.sense, self.model.robot.joints[link].a)
                    }
                    Site::Link { link, parameter: Parameter::D } => {
                        (true, t.basis.of, t.basis.sense, self.model.robot.joints[link - 1].d)
                    }
                    _ => (false, t.basis.of, None, 0.0),
                },
                // about a point of the axis: in part about its origin, in part about its foot
                Site::Across { joint } if part(t).is_some() => {
                    let share = part(t).unwrap();
                    let of = |axis| Variable::PartMoment { joint, axis, share };
                    match wanted {
                        Site::Tilt { joint: j, axis } if j == joint => (true, of(axis), t.basis.sense, 1.0 - share),
                        Site::Link { link, parameter: Parameter::Alpha } if link + 1 == joint => {
                            (true, of(Axis::X), t.basis.sense, share)
                        }
                        Site::Link { link, parameter: Parameter::Beta } if link + 1 == joint => {
                            (true, of(Axis::Y), t.basis.sense, share)
                        }
                        _ => (false, t.basis.of, None, 0.0),
                    }
                }
                Site::Across { joint } => match wanted {
                    Site::Tilt { joint: j, axis } if j == joint && !foot(t) => {
                        (true, Variable::Moment { joint, axis }, t.basis.sense, 1.0)
                    }
                    Site::Link { link, parameter: Parameter::Alpha } if link + 1 == joint && foot(t) => {
                        (true, Variable::FootMoment { joint, axis: Axis::X }, t.basis.sense, 1.0)
                    }
                    Site::Link { link, parameter: Parameter::Beta } if link + 1 == joint && foot(t) => {
                        (true, Variable::FootMoment { joint, axis: Axis::Y }, t.basis.sense, 1.0)
                    }
                    _ => (false, t.basis.of, None, 0.0),
                },
                _ => (direct, t.basis.of, t.basis.sense, 1.0),
            };
            if !hit {
                continue;
            }
            let basis = Basis { of, sense, ..t.basis };
            if basis.is_constant() {
                total += *v * weight;
                continue;
            }
            let Some((state, measured, moment)) = with else { continue };
            let u = match basis.of {
                Variable::Nothing => c(0.0),
                Variable::Joint { joint } => self.q[joint - 1],
                Variable::Moment { joint, axis } => moment(joint, axis, false),
                Variable::FootMoment { joint, axis } => moment(joint, axis, true),
                Variable::PartMoment { joint, axis, share } => {
                    moment(joint, axis, false) * (1.0 - share) + moment(joint, axis, true) * share
                }
                Variable::Torque { joint } => c(state.torques.unwrap()[joint - 1]),
                Variable::Inclination { first, last } => {
                    (first..=last).fold(c(0.0), |sum, joint| sum + self.q[joint - 1])
                }
                Variable::Lag { joint } => {
                    state.q_commanded.map_or(c(0.0), |commanded| c(commanded[joint - 1]) - self.q[joint - 1])
                }
                Variable::Time => c(state.t.unwrap()),
                Variable::Seq => c(state.seq.unwrap()),
                Variable::Temperature { reference_c } => c(state.temp_c.unwrap() - reference_c),
                Variable::Reading { axis } => match measured {
                    Measured::Touch { reading, .. } => c(reading[axis.index()]),
                    _ => c(0.0),
                },
            };
            let other_place = basis.place.is_some_and(|own| state.place != Some(own - 1));
            if basis.session.is_some_and(|own| state.session != Some(own)) || other_place {
                continue;
            }
            let s = basis.sense.map_or(1.0, |j| f64::from(state.dir.unwrap()[j - 1]));
            let beside = basis.beside.map_or(c(1.0), |b| shape(b.shape, self.q[b.joint - 1]));
            total += *v * weight * s * beside * shape(basis.shape, u);
        }
        total
    }

    /// Bearing axes, tilted z, origin and axes of each joint.
    fn frames(&self, with: Option<At<'_>>) -> (M, V, Vec<JointFrames>) {
        let robot = &self.model.robot;
        let base: [D; 6] = std::array::from_fn(|k| self.sum(Site::Base(Motion::ALL[k]), with));
        let mut r = mul(&zyx(&base), &mat(&self.model.cell.world_from_base.rotation));
        let mut p = plus(vec(&self.model.cell.world_from_base.translation), [base[0], base[1], base[2]]);
        let (base_r, base_p) = (r, p);
        p = plus(p, times(&r, vec(&robot.root_from_zero.translation)));
        r = mul(&r, &mat(&robot.root_from_zero.rotation));
        let mut out = Vec::new();
        for (i, j) in robot.joints.iter().enumerate() {
            let link = |parameter| {
                let link = if matches!(parameter, Parameter::Theta | Parameter::D) { i + 1 } else { i };
                self.sum(Site::Link { link, parameter }, with)
            };
            let own = self.sum(Site::Joint { joint: i + 1 }, with) + self.q[i];
            let prismatic = j.kind == JointKind::Prismatic;
            let theta = link(Parameter::Theta) + j.theta_offset + if prismatic { c(0.0) } else { own };
            let d = link(Parameter::D) + j.d + if prismatic { own } else { c(0.0) };
            p = plus(p, scale(col(&r, 0), link(Parameter::A) + j.a));
            r = mul(&r, &rot(0, link(Parameter::Alpha) + j.alpha));
            r = mul(&r, &rot(1, link(Parameter::Beta) + j.beta));
            p = plus(p, scale(col(&r, 2), d));
            let bearing = r;
            r = mul(&r, &rot(0, self.sum(Site::Tilt { joint: i + 1, axis: Axis::X }, with)));
            r = mul(&r, &rot(1, self.sum(Site::Tilt { joint: i + 1, axis: Axis::Y }, with)));
            let z = col(&r, 2);
            r = mul(&r, &rot(2, theta));
            out.push((bearing, z, p, r));
        }
        (base_r, base_p, out)
    }

    /// Where a joint's axis begins: before its offset d, with the constant terms.
    fn foot(&self, joint: usize) -> V {
        let (_, _, frames) = self.frames(None);
        let (bearing, _, origin, _) = &frames[joint - 1];
        let d = self.sum(Site::Link { link: joint, parameter: Parameter::D }, None);
        let j = &self.model.robot.joints[joint - 1];
        let own = if j.kind == JointKind::Prismatic {
            self.sum(Site::Joint { joint }, None) + self.q[joint - 1]
        } else {
            c(0.0)
        };
        minus(*origin, scale(col(bearing, 2), d + own + j.d))
    }

    /// Origin and axes of the flange.
    fn flange(&self, frames: &[JointFrames]) -> (V, M) {
        let (_, _, o, r) = frames.last().unwrap();
        let own = &self.model.robot.last_from_flange;
        (plus(*o, times(r, vec(&own.translation))), mul(r, &mat(&own.rotation)))
    }

    fn moment(&self, state: &State, joint: usize, axis: Axis, foot: bool) -> D {
        let (_, _, frames) = self.frames(None);
        let g: V =
            std::array::from_fn(|k| self.sum(Site::Gravity(Axis::ALL[k]), None) + if k == 2 { -GRAVITY } else { 0.0 });
        let (bearing, z, origin, _) = &frames[joint - 1];
        let o = &if foot { self.foot(joint) } else { *origin };
        let mut bodies: Vec<(D, V)> = Vec::new();
        for (j, f) in self.model.robot.joints.iter().zip(&frames).skip(joint - 1) {
            bodies.push((c(j.mass.unwrap()), plus(f.2, times(&f.3, vec(&j.cog)))));
        }
        let (flange_o, flange_r) = self.flange(&frames);
        let tool = &self.model.cell.tool;
        let extra = state.payload_kg.unwrap_or(0.0);
        // of what varies only a session's own payload comes before the moments
        let nothing = Measured::Point { target: 0, position: [0.0; 3] };
        let no_moment = |_: usize, _: Axis, _: bool| c(0.0);
        let here: Option<At<'_>> = Some((state, &nothing, &no_moment));
        let mass = self.sum(Site::Payload(Payload::Mass), here) + (tool.mass + extra);
        bodies.push((mass, plus(flange_o, times(&flange_r, vec(&tool.cog)))));
        let mu: V = std::array::from_fn(|k| self.sum(Site::Payload(Payload::Moment(Axis::ALL[k])), here));
        let prismatic = self.model.robot.joints[joint - 1].kind == JointKind::Prismatic && axis == Axis::Z;
        let e = if axis == Axis::Z && !prismatic && !foot { *z } else { col(bearing, axis.index()) };
        let mut total = c(0.0);
        for (m, at) in &bodies {
            let force = scale(g, *m);
            total += if prismatic { dot(e, force) } else { dot(e, cross(minus(*at, *o), force)) };
        }
        if !prismatic {
            total += dot(e, cross(times(&flange_r, mu), g));
        }
        total
    }

    fn residual(&self, state: &State, measured: &Measured) -> Vec<D> {
        let moment = |j: usize, a: Axis, foot: bool| self.moment(state, j, a, foot);
        let with: Option<At<'_>> = Some((state, measured, &moment));
        let (_, _, frames) = self.frames(with);
        let (o, r) = &self.flange(&frames);
        let cell = &self.model.cell;
        let tool: [D; 6] = std::array::from_fn(|k| self.sum(Site::Tool(Motion::ALL[k]), with));
        let still: [D; 3] = std::array::from_fn(|k| self.sum(Site::Tool(Motion::ALL[k]), None));
        let tcp = plus(vec(&cell.tool.tcp), [tool[0], tool[1], tool[2]]);
        let tool_r = mul(&zyx(&tool), &mat(&cell.tool.rotation));
        let at = |v: V| plus(*o, times(r, v));
        let frame = |p: V| -> (V, M) {
            let f: [D; 6] = std::array::from_fn(|k| self.sum(Site::Frame { frame: 1, motion: Motion::ALL[k] }, with));
            let rf = mul(&zyx(&f), &mat(&self.model.frames[0].rotation));
            (plus(plus(times(&rf, p), vec(&self.model.frames[0].translation)), [f[0], f[1], f[2]]), rf)
        };
        match measured {
            Measured::Touch { ball, reading } => {
                let p = at(plus(tcp, times(&tool_r, reading.map(c))));
                let f: [D; 6] = std::array::from_fn(|k| self.sum(Site::Fixture(Motion::ALL[k]), with));
                let b: V = std::array::from_fn(|k| {
                    self.sum(Site::Ball { ball: ball + 1, axis: Axis::ALL[k] }, with) + cell.balls[*ball][k]
                });
                minus(p, plus(times(&zyx(&f), b), [f[0], f[1], f[2]])).to_vec()
            }
            Measured::Point { target, position } => {
                let t: V = std::array::from_fn(|k| {
                    self.sum(Site::Target { target: target + 1, axis: Axis::ALL[k] }, with)
                        + cell.tool.targets[*target][k]
                        + tool[k]
                        - still[k]
                });
                minus(frame(at(t)).0, position.map(c)).to_vec()
            }
            Measured::Distance { anchor, length } => {
                let a: V = std::array::from_fn(|k| {
                    self.sum(Site::Anchor { anchor: anchor + 1, axis: Axis::ALL[k] }, with) + cell.anchors[*anchor][k]
                });
                let v = minus(at(tcp), a);
                vec![dot(v, v).sqrt() + self.sum(Site::LengthZero { anchor: anchor + 1 }, with) - *length]
            }
            Measured::Pose { position, quaternion } => {
                let (p, rf) = frame(at(tcp));
                let m = mat(&trical_model::pose::rotation_from_quaternion(*quaternion));
                let e = mul(&transpose(&m), &mul(&rf, &mul(r, &tool_r)));
                let v = log(&e);
                let mut out = minus(p, position.map(c)).to_vec();
                out.extend(v);
                out
            }
            Measured::Reference { .. } => Vec::new(),
        }
    }
}

struct Draw(StdRng);

impl Draw {
    fn n(&mut self, s: f64) -> f64 {
        self.0.random_range(-s..s)
    }
    fn v(&mut self, s: f64) -> Vector3<f64> {
        Vector3::new(self.n(s), self.n(s), self.n(s))
    }
    fn below(&mut self, k: usize) -> usize {
        self.0.random_range(0..k)
    }

    fn robot(&mut self) -> Robot {
        let n = 1 + self.below(9);
        let joints = (0..n)
            .map(|_| Joint {
                kind: if self.below(4) == 0 { JointKind::Prismatic } else { JointKind::Revolute },
                alpha: self.n(3.0),
                a: self.n(0.5),
                beta: if self.below(3) == 0 { self.n(1.0) } else { 0.0 },
                d: self.n(0.5),
                theta_offset: self.n(3.0),
                limits: [-3.0, 3.0],
                mass: Some(1.0 + self.n(0.9)),
                cog: self.v(0.2),
            })
            .collect();
        let mut constant =
            || Pose { rotation: rotation_zyx(self.n(3.0), self.n(1.5), self.n(3.0)), translation: self.v(0.3) };
        let (root_from_zero, last_from_flange) = (constant(), constant());
        Robot { name: "random".into(), joints, root_from_zero, last_from_flange, joint_names: Vec::new() }
    }

    fn cell(&mut self) -> Cell {
        Cell {
            world_from_base: Pose {
                rotation: rotation_zyx(self.n(3.0), self.n(1.5), self.n(3.0)),
                translation: self.v(0.5),
            },
            tool: Tool {
                tcp: self.v(0.2),
                rotation: rotation_zyx(self.n(3.0), self.n(1.5), self.n(3.0)),
                targets: vec![self.v(0.2), self.v(0.2)],
                mass: 1.5,
                cog: self.v(0.1),
            },
            balls: vec![self.v(0.5), self.v(0.5)],
            anchors: vec![self.v(2.0)],
            geometry: None,
        }
    }

    fn basis(&mut self, n: usize) -> Basis {
        let joint = 1 + self.below(n);
        let of = match self.below(11) {
            0 => Variable::Nothing,
            1 => Variable::Joint { joint },
            2 => Variable::Moment { joint, axis: Axis::ALL[self.below(3)] },
            3 => Variable::FootMoment { joint, axis: Axis::ALL[self.below(3)] },
            4 => Variable::Lag { joint },
            5 => Variable::Time,
            6 => Variable::Temperature { reference_c: 20.0 },
            7 => Variable::Seq,
            8 => Variable::Torque { joint },
            9 => Variable::Inclination { first: joint, last: joint + self.below(n + 1 - joint) },
            _ => Variable::Reading { axis: Axis::ALL[self.below(3)] },
        };
        let shape = match self.below(14) {
            0 => Shape::One,
            1 | 2 => Shape::Linear,
            3 => Shape::Absolute,
            4 => Shape::SignedSquare,
            5 => Shape::Cube,
            6 => Shape::SoftSign { scale: 20.0 },
            7 => Shape::Sine { cycles: 2.0 },
            8 => Shape::Cosine { cycles: 3.0 },
            9 => Shape::Step { at: 0.1 },
            10 => Shape::Hinge { at: -0.2 },
            11 => Shape::Growth { from: 0.3, to: -1.1 },
            12 => Shape::Clip { at: 0.7 },
            _ => Shape::WarmUp { constant: 3.0 },
        };
        // elsewhere it would be an exponential without end
        let of = if matches!(shape, Shape::WarmUp { .. }) { Variable::Time } else { of };
        let sense = (self.below(3) == 0).then(|| 1 + self.below(n));
        let beside =
            (self.below(4) == 0).then(|| Beside { joint: 1 + self.below(n), shape: Shape::Cosine { cycles: 2.0 } });
        let session = (self.below(4) == 0).then(|| 1 + u32::from(self.below(2) == 0));
        // one session's balls at one place
        let place = session.filter(|own| *own == 2).map(|_| 1);
        Basis { of, shape, sense, beside, session, place }
    }

    fn terms(&mut self, n: usize) -> Vec<Term> {
        let mut sites: Vec<Site> = Vec::new();
        for k in 0..n {
            for parameter in [Parameter::Alpha, Parameter::A, Parameter::Beta] {
                sites.push(Site::Link { link: k, parameter });
            }
            for parameter in [Parameter::Theta, Parameter::D] {
                sites.push(Site::Link { link: k + 1, parameter });
            }
            sites.push(Site::Joint { joint: k + 1 });
            sites.push(Site::Tilt { joint: k + 1, axis: Axis::X });
            sites.push(Site::Tilt { joint: k + 1, axis: Axis::Y });
        }
        for m in Motion::ALL {
            sites.extend([Site::Base(m), Site::Tool(m), Site::Fixture(m), Site::Frame { frame: 1, motion: m }]);
        }
        let movable = sites.len();
        for axis in Axis::ALL {
            sites.extend([
                Site::Target { target: 2, axis },
                Site::Ball { ball: 1, axis },
                Site::Gravity(axis),
                Site::Payload(Payload::Moment(axis)),
                Site::Anchor { anchor: 1, axis },
            ]);
        }
        sites.push(Site::Payload(Payload::Mass));
        sites.push(Site::LengthZero { anchor: 1 });
        let mut terms: Vec<Term> =
            sites.iter().map(|s| Term::new(format!("{s:?}"), "geometry", *s, Basis::CONSTANT)).collect();
        for k in 0..12 {
            let site = match k {
                0 => Site::Across { joint: 1 + self.below(n) },
                1 => Site::AllJoints,
                2 => Site::Links,
                _ => sites[self.below(movable)],
            };
            let basis = match k {
                0 if self.below(3) == 0 => Basis::new(Variable::FootMoment { joint: 1, axis: Axis::X }, Shape::Linear),
                0 if self.below(2) == 0 => {
                    Basis::new(Variable::PartMoment { joint: 1, axis: Axis::X, share: 0.3 }, Shape::Linear)
                }
                0 => Basis::new(Variable::Moment { joint: 1, axis: Axis::X }, Shape::Linear),
                1 => Basis::new(Variable::Lag { joint: 1 }, Shape::Linear),
                3 => Basis::torque(1 + self.below(n), Shape::Linear),
                _ => self.basis(n),
            };
            let site = if k == 3 { Site::Joint { joint: 1 + self.below(n) } } else { site };
            terms.push(Term::new(format!("vary{k}"), "test", site, basis));
        }
        for axis in Axis::ALL {
            let own = Basis::CONSTANT.in_session(2);
            for site in [Site::Target { target: 1, axis }, Site::Payload(Payload::Moment(axis))] {
                terms.push(Term::new(format!("{site:?} of session 2"), "setup", site, own));
            }
        }
        let own_mass = Basis::CONSTANT.in_session(2);
        terms.push(Term::new("mass of session 2", "setup", Site::Payload(Payload::Mass), own_mass));
        for t in &mut terms {
            let torque = matches!(
                t.basis.of,
                Variable::Moment { .. } | Variable::FootMoment { .. } | Variable::PartMoment { .. }
            );
            t.value = self.n(0.02)
                * if !torque {
                    1.0
                } else if t.basis.shape == Shape::Linear {
                    0.1
                } else {
                    1e-5
                };
        }
        terms
    }

    fn state(&mut self, n: usize) -> State {
        let q: Vec<f64> = (0..n).map(|_| self.n(2.5)).collect();
        let mut s = State::at(&q);
        let mut qc = s.q;
        for x in qc.iter_mut().take(n) {
            *x += self.n(0.1);
        }
        s.q_commanded = Some(qc);
        s.dir = Some(std::array::from_fn(|_| if self.below(2) == 0 { -1 } else { 1 }));
        s.t = Some(5.0 + self.n(4.0));
        s.seq = Some(5.0 + self.n(4.0));
        s.temp_c = Some(24.0 + self.n(3.0));
        s.payload_kg = Some(0.3);
        s.torques = Some(std::array::from_fn(|_| self.n(20.0)));
        s.session = Some(1 + u32::from(self.below(2) == 0));
        s.place = Some(usize::from(s.q[0] > 0.0));
        s
    }

    fn measured(&mut self) -> Measured {
        let v = self.v(0.5);
        match self.below(4) {
            0 => Measured::Touch { ball: self.below(2), reading: (self.v(0.01)).into() },
            1 => Measured::Point { target: self.below(2), position: v.into() },
            2 => Measured::Distance { anchor: 0, length: 1.0 },
            _ => Measured::Pose {
                position: v.into(),
                quaternion: quaternion_from_rotation(&rotation_zyx(self.n(3.0), self.n(1.4), self.n(3.0))),
            },
        }
    }
}

fn close(a: f64, b: f64, size: f64, what: &str) {
    assert!((a - b).abs() <= 1e-9 * size.max(1e-3), "{what}: ours {a}, naive {b}");
}

#[test]
fn every_column_agrees_with_automatic_differentiation_on_random_arms_and_poses() {
    let mut draw = Draw(StdRng::seed_from_u64(7));
    for trial in 0..2000 {
        let (robot, cell) = (draw.robot(), draw.cell());
        let n = robot.dof();
        let mut terms = draw.terms(n);
        if trial % 3 == 0 {
            // a plain calibration: each term is one motion, the same at all poses
            let by_several = |t: &Term| matches!(t.site, Site::AllJoints | Site::Links);
            terms.retain(|t| t.basis == Basis::CONSTANT && !by_several(t));
        }
        let model = Model {
            robot,
            cell,
            frames: vec![Pose {
                rotation: rotation_zyx(draw.n(3.0), draw.n(1.4), draw.n(3.0)),
                translation: draw.v(3.0),
            }],
            terms,
        };
        let p = model.terms.len();
        let forward = Forward::new(model.clone(), (0..p).collect()).unwrap();
        let mut ws = forward.workspace();
        let (state, measured) = (draw.state(n), draw.measured());
        forward.check(&state, &measured, 0).unwrap();
        let mut jacobian = vec![f64::NAN; 6 * p];
        let rows = forward.linearize(&state, &measured, 0, &mut ws, &mut jacobian);
        assert_eq!(rows, residual_rows(&measured));
        if ws.residual()[3..].iter().map(|x| x * x).sum::<f64>().sqrt() > 3.0 {
            continue; // nearly half a turn off: a rotation vector has no nine digits there
        }
        // nothing else that was measured in that state before, with what bases say of it kept, changes anything
        let (mut again, mut after) = (forward.workspace(), vec![f64::NAN; 6 * p]);
        forward.linearize(&state, &draw.measured(), 0, &mut again, &mut after);
        forward.linearize_next(true, &state, (&measured, 0), &mut again, &mut after);
        assert_eq!((&after[..rows * p], again.residual()), (&jacobian[..rows * p], ws.residual()));
        // thousands of arms, a dozen random columns each, all columns every fiftieth time
        let every = trial % 50 == 0;
        let columns: Vec<usize> = if every { (0..p).collect() } else { (0..12).map(|_| draw.below(p)).collect() };
        for k in columns {
            let mut values: Vec<D> = model.terms.iter().map(|t| c(t.value)).collect();
            values[k].eps = 1.0;
            let naive = Naive { model: &model, values, q: state.q[..n].iter().map(|x| c(*x)).collect() };
            let expected = naive.residual(&state, &measured);
            let size = expected.iter().map(|e| e.eps.abs()).fold(0.0, f64::max);
            for (row, e) in expected.iter().enumerate() {
                close(ws.residual()[row], e.re, 1.0, "residual");
                close(jacobian[row * p + k], e.eps, size, &format!("{measured:?} {:?}", model.terms[k]));
            }
        }
    }
}

#[test]
fn the_joint_jacobian_agrees_with_automatic_differentiation() {
    let mut draw = Draw(StdRng::seed_from_u64(8));
    for trial in 0..300 {
        let (robot, cell) = (draw.robot(), draw.cell());
        let n = robot.dof();
        let mut terms = draw.terms(n);
        // a reading belongs to a touch; the tool's pose is asked without one
        terms.retain(|t| !matches!(t.basis.of, Variable::Reading { .. }));
        let model = Model { robot, cell, frames: vec![Pose::identity()], terms };
        let forward = Forward::new(model.clone(), Vec::new()).unwrap();
        let mut ws = forward.workspace();
        let mut state = draw.state(n);
        if trial % 2 == 0 {
            state.q_commanded = None;
        }
        let mut jacobian = vec![0.0; 6 * n];
        let pose = forward.joint_jacobian(&state, &mut ws, &mut jacobian);
        for k in 0..n {
            let mut q: Vec<D> = state.q[..n].iter().map(|x| c(*x)).collect();
            q[k].eps = 1.0;
            let values = model.terms.iter().map(|t| c(t.value)).collect();
            let naive = Naive { model: &model, values, q };
            // the distance to three far anchors would do; the point of a touch with zero reading is simpler
            let touch = Measured::Touch { ball: 0, reading: [0.0; 3] };
            let moment = |j: usize, a: Axis, foot: bool| naive.moment(&state, j, a, foot);
            let with: Option<At<'_>> = Some((&state, &touch, &moment));
            let (_, _, frames) = naive.frames(with);
            let (o, r) = &naive.flange(&frames);
            let tool: [D; 6] = std::array::from_fn(|m| naive.sum(Site::Tool(Motion::ALL[m]), with));
            let tcp = plus(vec(&model.cell.tool.tcp), [tool[0], tool[1], tool[2]]);
            let x = plus(*o, times(r, tcp));
            let rt = mul(r, &mul(&zyx(&tool), &mat(&model.cell.tool.rotation)));
            let size = x.iter().map(|e| e.eps.abs()).fold(1.0, f64::max);
            for row in 0..3 {
                close(pose.translation[row], x[row].re, 1.0, "position");
                close(jacobian[row * n + k], x[row].eps, size, "velocity");
            }
            // angular velocity from dR R'
            let d = |i: usize, j: usize| (0..3).map(|m| rt[i][m].eps * rt[j][m].re).sum::<f64>();
            for (row, w) in [d(2, 1), d(0, 2), d(1, 0)].into_iter().enumerate() {
                close(jacobian[(3 + row) * n + k], w, size, "angular velocity");
            }
        }
    }
}
