//! Reading `[geometry]`.

use nalgebra::Vector3;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use toml::Value;
use trical_model::{Cell, Pose, Robot, Tool};

use super::{Balls, Body, Place, Role, derived};
use crate::error::{PlanError, Result};
use crate::solid::{Solid, distance, pose_zyx};

type V3 = Vector3<f64>;

/// What the file says; `None` where it says nothing.
pub(super) struct Sections {
    pub margin: f64,
    pub retreat: Option<V3>,
    pub ignore: Vec<(String, String)>,
    pub balls: Option<Balls>,
    pub links: Option<Vec<Body>>,
    pub device: Option<Vec<Body>>,
    pub obstacles: Option<Vec<Body>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GeometryFile {
    margin_mm: Option<f64>,
    retreat: Option<[f64; 3]>,
    #[serde(default)]
    ignore: Vec<[String; 2]>,
    balls: Option<Value>,
    link: Option<Vec<Value>>,
    device: Option<Vec<Value>>,
    obstacle: Option<Vec<Value>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BallsFile {
    diameter_mm: Option<f64>,
    post_radius_mm: Option<f64>,
    post_length_mm: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LinkFile {
    link: usize,
    name: Option<String>,
    solids: Vec<Value>,
}

#[derive(Clone, Copy, Default, Deserialize, PartialEq)]
#[serde(rename_all = "snake_case")]
enum DeviceFrame {
    #[default]
    Flange,
    Tool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DeviceFile {
    name: String,
    #[serde(default)]
    frame: DeviceFrame,
    #[serde(default)]
    touches: bool,
    solids: Vec<Value>,
}

#[derive(Clone, Copy, Default, Deserialize, PartialEq)]
#[serde(rename_all = "snake_case")]
enum ObstacleFrame {
    #[default]
    World,
    Base,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ObstacleFile {
    name: String,
    #[serde(default)]
    frame: ObstacleFrame,
    solids: Vec<Value>,
}

#[derive(Deserialize)]
#[serde(tag = "shape", rename_all = "snake_case", deny_unknown_fields)]
enum SolidFile {
    Sphere {
        center_mm: [f64; 3],
        radius_mm: f64,
    },
    Capsule {
        from_mm: [f64; 3],
        to_mm: [f64; 3],
        radius_mm: f64,
    },
    Cylinder {
        from_mm: [f64; 3],
        to_mm: [f64; 3],
        radius_mm: f64,
    },
    Box {
        center_mm: [f64; 3],
        size_mm: [f64; 3],
        #[serde(default)]
        zyx_deg: [f64; 3],
        #[serde(default)]
        rounding_mm: f64,
    },
    Hull {
        points_mm: Vec<[f64; 3]>,
        #[serde(default)]
        rounding_mm: f64,
    },
}

fn bad(place: impl Into<String>, problem: impl Into<String>) -> PlanError {
    PlanError::Geometry { place: place.into(), problem: problem.into() }
}

fn take<T: DeserializeOwned>(value: Value, place: &str) -> Result<T> {
    value.try_into().map_err(|e: toml::de::Error| bad(place, e.message().replace('\n', " ")))
}

fn number(place: &str, field: &str, mm: f64, least: f64, most: f64) -> Result<f64> {
    if mm.is_finite() && (least..=most).contains(&mm) {
        Ok(mm * 1e-3)
    } else {
        Err(bad(format!("{place}, {field}"), format!("found {mm}, expected {least} to {most} mm")))
    }
}

fn point(place: &str, field: &str, mm: [f64; 3]) -> Result<V3> {
    if mm.iter().all(|x| x.is_finite() && x.abs() < 1e6) {
        Ok(V3::from(mm) * 1e-3)
    } else {
        Err(bad(format!("{place}, {field}"), format!("found {mm:?}, expected three finite numbers")))
    }
}

fn solid(value: Value, frame: &Pose, place: &str) -> Result<Solid> {
    let at = |field, mm| Ok::<V3, PlanError>(frame.apply(&point(place, field, mm)?));
    let radius = |mm| number(place, "radius_mm", mm, 0.1, 1e5);
    let rounding = |mm| number(place, "rounding_mm", mm, 0.0, 1e5);
    Ok(match take(value, place)? {
        SolidFile::Sphere { center_mm, radius_mm } => Solid::sphere(at("center_mm", center_mm)?, radius(radius_mm)?),
        SolidFile::Capsule { from_mm, to_mm, radius_mm } => {
            Solid::capsule(at("from_mm", from_mm)?, at("to_mm", to_mm)?, radius(radius_mm)?)
        }
        SolidFile::Cylinder { from_mm, to_mm, radius_mm } => {
            Solid::cylinder(at("from_mm", from_mm)?, at("to_mm", to_mm)?, radius(radius_mm)?)
                .ok_or_else(|| bad(place, "from_mm and to_mm are the same point, expected a cylinder of some height"))?
        }
        SolidFile::Box { center_mm, size_mm, zyx_deg, rounding_mm } => {
            let size = point(place, "size_mm", size_mm)?;
            if size.min() < 1e-4 {
                return Err(bad(
                    format!("{place}, size_mm"),
                    format!("found {size_mm:?}, expected three edges of 0.1 mm or more"),
                ));
            }
            let zyx = point(place, "zyx_deg", zyx_deg)? * 1e3;
            let own = pose_zyx(point(place, "center_mm", center_mm)?, [zyx.x, zyx.y, zyx.z].map(f64::to_radians));
            Solid::cuboid(frame.compose(&own), size, rounding(rounding_mm)?)
        }
        SolidFile::Hull { points_mm, rounding_mm } => {
            let points = points_mm.iter().map(|p| at("points_mm", *p)).collect::<Result<Vec<_>>>()?;
            Solid::hull(&points, rounding(rounding_mm)?).ok_or_else(|| {
                bad(
                    format!("{place}, points_mm"),
                    format!("{} points in one plane, expected four or more that span a volume", points.len()),
                )
            })?
        }
    })
}

fn solids(values: Vec<Value>, frame: &Pose, place: &str) -> Result<Vec<Solid>> {
    if values.is_empty() {
        return Err(bad(place, "solids is empty, expected one solid or more"));
    }
    values.into_iter().enumerate().map(|(k, v)| solid(v, frame, &format!("{place}, solid {}", k + 1))).collect()
}

/// `f` of every entry of a list, with its place in words.
fn each<T: DeserializeOwned>(
    list: Option<Vec<Value>>,
    section: &str,
    f: impl Fn(T, &str) -> Result<Body>,
) -> Result<Option<Vec<Body>>> {
    list.map(|entries| {
        entries
            .into_iter()
            .enumerate()
            .map(|(k, v)| {
                let place = format!("[[geometry.{section}]] {}", k + 1);
                f(take(v, &place)?, &place)
            })
            .collect()
    })
    .transpose()
}

/// What the file says of the balls, and what is usual.
fn balls(value: Value, cell: &Cell) -> Result<Balls> {
    let place = "[geometry.balls]";
    let b: BallsFile = take(value, place)?;
    let usual = derived::balls(cell);
    let or = |field, mm: Option<f64>, usual: f64, most| mm.map_or(Ok(usual), |mm| number(place, field, mm, 0.1, most));
    Ok(Balls {
        radius: or("diameter_mm", b.diameter_mm, usual.radius * 2.0, 1e3)? * 0.5,
        post_radius: or("post_radius_mm", b.post_radius_mm, usual.post_radius, 1e3)?,
        post_length: or("post_length_mm", b.post_length_mm, usual.post_length, 1e4)?,
    })
}

impl LinkFile {
    /// Of an arm with `n` joints.
    fn body(self, n: usize, place: &str) -> Result<Body> {
        if self.link > n {
            return Err(bad(
                format!("{place}, link"),
                format!("found {}, expected 0 (the base) to {n} (the flange)", self.link),
            ));
        }
        Ok(Body {
            name: self.name.unwrap_or_else(|| format!("link {}", self.link)),
            place: Place::Link(self.link),
            role: Role::Plain,
            device: false,
            solids: solids(self.solids, &Pose::identity(), place)?,
        })
    }
}

impl DeviceFile {
    /// On link `n`, the flange.
    fn body(self, tool: &Tool, n: usize, place: &str) -> Result<Body> {
        let flange_from_tool = Pose { rotation: tool.rotation, translation: tool.tcp };
        let frame = if self.frame == DeviceFrame::Tool { flange_from_tool } else { Pose::identity() };
        let solids = solids(self.solids, &frame, place)?;
        let role = if self.touches {
            let side = solids.iter().map(|s| s.centre).sum::<V3>() / solids.len().max(1) as f64 - tool.tcp;
            if side.norm() < 1e-6 {
                return Err(bad(
                    place,
                    "touches = true, but the solid is centred on the TCP and lies to no side of it",
                ));
            }
            Role::Stem(tool.rotation.transpose() * side.normalize())
        } else {
            Role::Plain
        };
        Ok(Body { name: self.name, place: Place::Link(n), role, device: true, solids })
    }
}

impl ObstacleFile {
    fn body(self, cell: &Cell, place: &str) -> Result<Body> {
        let frame = if self.frame == ObstacleFrame::Base { cell.world_from_base } else { Pose::identity() };
        let solids = solids(self.solids, &frame, place)?;
        Ok(Body { name: self.name, place: Place::World, role: Role::Plain, device: false, solids })
    }
}

pub(super) fn read(robot: &Robot, cell: &Cell) -> Result<Sections> {
    let table = cell.geometry.clone().unwrap_or_default();
    let raw: GeometryFile = take(Value::Table(table), "[geometry]")?;
    let n = robot.dof();
    let margin = number("[geometry]", "margin_mm", raw.margin_mm.unwrap_or(5.0), 0.2, 100.0)?;
    let retreat = match raw.retreat {
        None => None,
        Some(v) if v.iter().all(|x| x.is_finite()) && V3::from(v).norm() > 1e-6 => Some(V3::from(v).normalize()),
        Some(v) => return Err(bad("[geometry], retreat", format!("found {v:?}, expected a direction"))),
    };
    let balls = raw.balls.map(|b| balls(b, cell)).transpose()?;
    Ok(Sections {
        margin,
        retreat,
        ignore: raw.ignore.into_iter().map(|[a, b]| (a, b)).collect(),
        balls,
        links: each(raw.link, "link", |l: LinkFile, place| l.body(n, place))?,
        device: each(raw.device, "device", |d: DeviceFile, place| d.body(&cell.tool, n, place))?,
        obstacles: each(raw.obstacle, "obstacle", |o: ObstacleFile, place| o.body(cell, place))?,
    })
}

/// The direction in which the device leaves a ball, unit vector in the tool's axes: what the file says, or away from the ball
/// along all stems, or backwards along the tool's z axis. Refuses a direction that would push a stem through the ball.
pub(super) fn retreat(said: Option<V3>, bodies: &[Body]) -> Result<V3> {
    let stems: Vec<(&str, V3)> = bodies
        .iter()
        .filter_map(|b| if let Role::Stem(side) = b.role { Some((b.name.as_str(), side)) } else { None })
        .collect();
    let usual = stems.iter().map(|s| s.1).sum::<V3>().try_normalize(1e-6).unwrap_or(-V3::z());
    let direction = said.unwrap_or(usual);
    match stems.iter().find(|s| s.1.dot(&direction) < 0.05) {
        None => Ok(direction),
        Some((name, side)) => Err(bad(
            "[geometry], retreat",
            format!(
                "found [{:.3}, {:.3}, {:.3}], which pushes '{name}' into the ball, expected a direction that leads away from \
                 it, towards [{:.3}, {:.3}, {:.3}]",
                direction.x, direction.y, direction.z, side.x, side.y, side.z
            ),
        )),
    }
}

/// How far a ball may reach into something that stands still, m: drawings are rounded.
const INTO: f64 = 1e-3;

/// Refuses a ball inside an obstacle, the base, another ball or another ball's post: nothing could touch it.
pub(super) fn check_balls_stand_free(bodies: &[Body]) -> Result<()> {
    let still = Pose::identity();
    for ball in bodies.iter().filter(|b| matches!(b.role, Role::Ball(_))) {
        let post = ball.name.replacen("ball", "post", 1);
        for other in bodies.iter().filter(|o| o.place == Place::World && o.name != ball.name && o.name != post) {
            let depth = |a: &Solid, b: &Solid| -distance(&still, a, &still, b);
            let into = ball
                .solids
                .iter()
                .flat_map(|a| other.solids.iter().map(move |b| depth(a, b)))
                .fold(f64::NEG_INFINITY, f64::max);
            if into > INTO {
                return Err(bad(
                    "[geometry]",
                    format!(
                        "'{}' reaches {:.1} mm or more into '{}', expected balls that stand free: nothing could touch it",
                        ball.name,
                        into * 1e3,
                        other.name
                    ),
                ));
            }
        }
    }
    Ok(())
}

/// Refuses two bodies of one name, and `ignore` of a body that does not exist.
pub(super) fn check_names(bodies: &[Body], ignore: &[(String, String)]) -> Result<()> {
    for (k, body) in bodies.iter().enumerate() {
        if bodies.iter().take(k).any(|b| b.name == body.name) {
            return Err(bad("[geometry]", format!("two bodies are called '{}', expected different names", body.name)));
        }
    }
    for name in ignore.iter().flat_map(|(a, b)| [a, b]) {
        if !bodies.iter().any(|b| b.name == *name) {
            let known: Vec<&str> = bodies.iter().map(|b| b.name.as_str()).collect();
            return Err(bad(
                "[geometry], ignore",
                format!("'{name}' is no body of this cell, expected one of: {}", known.join(", ")),
            ));
        }
    }
    Ok(())
}
