//! Bodies from mesh files: STL (text or binary) and OBJ.
//!
//! A mesh becomes convex solids that contain it: the hull of the whole, or of each of its connected shells. A body that lies
//! wholly inside an open surface would be reported free; inside a hull it is not, and holes in a mesh do no harm. A hull of many
//! corners is replaced by one of few, thickened by as much as the others stick out, so that nothing is lost.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Vector3;
use parry3d_f64::glamx::DVec3;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::ConvexPolyhedron;
use toml::{Table, Value};
use trical_model::{Cell, trig};

use crate::error::{PlanError, Result};
use crate::solid::Solid;

type V3 = Vector3<f64>;

/// A mesh file may have this many bytes.
const LARGEST_FILE: u64 = 256 << 20;
/// A mesh may be this large, mm: more is a wrong unit.
const LARGEST: f64 = 1e5;
/// Corners of a hull that is checked thousands of times a second.
const CORNERS: u32 = 48;

/// Replaces every `shape = "mesh"` in the cell's `[geometry]` by hulls, so that the cell holds all that it needs. Names of files
/// are relative to `folder`.
///
/// # Errors
/// [`PlanError::Geometry`] names section, file, what was found and what is expected.
pub fn resolve_meshes(cell: &mut Cell, folder: &Path) -> Result<()> {
    let Some(geometry) = &mut cell.geometry else { return Ok(()) };
    for section in ["link", "device", "obstacle"] {
        let Some(Value::Array(bodies)) = geometry.get_mut(section) else { continue };
        for (k, body) in bodies.iter_mut().enumerate() {
            let Some(Value::Array(solids)) = body.get_mut("solids") else { continue };
            let mut out = Vec::with_capacity(solids.len());
            for (s, solid) in solids.iter().enumerate() {
                match solid.as_table() {
                    Some(t) if t.get("shape").and_then(Value::as_str) == Some("mesh") => {
                        let place = format!("[[geometry.{section}]] {}, solid {}", k + 1, s + 1);
                        out.extend(hulls(t, folder, &place)?);
                    }
                    _ => out.push(solid.clone()),
                }
            }
            *solids = out;
        }
    }
    Ok(())
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct MeshEntry {
    #[serde(rename = "shape")]
    _shape: String,
    file: String,
    /// Millimetres in a unit of the file.
    unit_mm: Option<f64>,
    /// Whether each connected shell is a solid of its own.
    #[serde(default)]
    shells: bool,
    #[serde(default)]
    rounding_mm: f64,
    /// Where the mesh's own origin lies, and how it is turned.
    #[serde(default)]
    at_mm: [f64; 3],
    #[serde(default)]
    zyx_deg: [f64; 3],
}

fn hulls(entry: &Table, folder: &Path, place: &str) -> Result<Vec<Value>> {
    let bad = |field: &str, problem: String| PlanError::Geometry { place: format!("{place}{field}"), problem };
    let e: MeshEntry =
        Value::Table(entry.clone()).try_into().map_err(|e: toml::de::Error| bad("", e.message().replace('\n', " ")))?;
    let unit = e.unit_mm.unwrap_or(1.0);
    if !(unit.is_finite() && unit > 0.0) {
        return Err(bad(", unit_mm", format!("found {unit}, expected the millimetres in a unit of the file")));
    }
    if !(e.rounding_mm.is_finite() && (0.0..=1e4).contains(&e.rounding_mm)) {
        return Err(bad(", rounding_mm", format!("found {}, expected 0 to 10000", e.rounding_mm)));
    }
    if !e.at_mm.iter().chain(&e.zyx_deg).all(|x| x.is_finite() && x.abs() < 1e6) {
        return Err(bad(", at_mm, zyx_deg", "found numbers that are not finite, expected a place and angles".into()));
    }
    let of_file = |problem: String| bad(", file", format!("{}: {problem}", e.file));
    let path = folder.join(&e.file);
    let size = std::fs::metadata(&path).map_err(|x| of_file(format!("cannot be read: {x}")))?.len();
    if size > LARGEST_FILE {
        return Err(of_file(format!("found {} MiB, expected at most {}", size >> 20, LARGEST_FILE >> 20)));
    }
    let bytes = std::fs::read(&path).map_err(|x| of_file(format!("cannot be read: {x}")))?;
    let mesh = parse(&bytes, &e.file).map_err(of_file)?;
    let shells = if e.shells { mesh.shells() } else { vec![mesh.points] };
    let z = e.zyx_deg.map(f64::to_radians);
    let turn = trical_model::pose::rotation_zyx(z[0], z[1], z[2]);
    let at = V3::from(e.at_mm);
    shells
        .into_iter()
        .enumerate()
        .map(|(k, points)| {
            let points: Vec<V3> = points.iter().map(|p| at + turn * p * unit).collect();
            let which = if e.shells { format!("shell {}: ", k + 1) } else { String::new() };
            let (corners, stick_out) = few_corners(&points).map_err(|problem| of_file(format!("{which}{problem}")))?;
            let mut t = Table::new();
            t.insert("shape".into(), Value::String("hull".into()));
            let list = |p: &V3| Value::Array(p.iter().map(|x| Value::Float(*x)).collect());
            t.insert("points_mm".into(), Value::Array(corners.iter().map(list).collect()));
            t.insert("rounding_mm".into(), Value::Float(e.rounding_mm + stick_out));
            Ok(Value::Table(t))
        })
        .collect()
}

/// Some of the points, and how far the others lie outside their hull at most, mm.
fn few_corners(points: &[V3]) -> std::result::Result<(Vec<V3>, f64), String> {
    let flat = || format!("found {} points in one plane, expected a body with a volume", points.len());
    let far = points.iter().flat_map(|p| p.iter().copied()).fold(0.0, |m: f64, x| m.max(x.abs()));
    if far > LARGEST {
        return Err(format!(
            "reaches {far:.0} mm from its origin, expected at most {LARGEST:.0}; unit_mm says how long a unit is"
        ));
    }
    let mut corners: Vec<V3> = Vec::new();
    for k in 0..CORNERS {
        // evenly over the sphere (Fibonacci)
        let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(CORNERS);
        let (s, c) = trig::sin_cos(f64::from(k) * 2.399_963_229_728_653);
        let flat = (1.0 - z * z).sqrt();
        let direction = V3::new(flat * c, flat * s, z);
        let best = points.iter().max_by(|a, b| direction.dot(a).total_cmp(&direction.dot(b)));
        if let Some(p) = best
            && !corners.contains(p)
        {
            corners.push(*p);
        }
    }
    // the check that a cell's own hulls go through, in metres
    let metres: Vec<V3> = corners.iter().map(|p| p * 1e-3).collect();
    if Solid::hull(&metres, 0.0).is_none() {
        return Err(flat());
    }
    let list: Vec<DVec3> = corners.iter().map(|p| DVec3::new(p.x, p.y, p.z)).collect();
    let hull = ConvexPolyhedron::from_convex_hull(&list).ok_or_else(flat)?;
    let out = points.iter().map(|p| hull.distance_to_local_point(DVec3::new(p.x, p.y, p.z), true)).fold(0.0, f64::max);
    Ok((corners, out))
}

/// Points and triangles.
struct Mesh {
    points: Vec<V3>,
    faces: Vec<[usize; 3]>,
}

impl Mesh {
    fn checked(points: Vec<V3>, faces: Vec<[usize; 3]>) -> std::result::Result<Self, String> {
        if faces.is_empty() {
            return Err("has no triangles, expected a closed body".into());
        }
        if let Some(k) = points.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(format!("vertex {} is not finite, expected numbers", k + 1));
        }
        Ok(Self { points, faces })
    }

    /// Points that triangles connect, shell by shell, in the order of the file. Corners at one place are one.
    fn shells(&self) -> Vec<Vec<V3>> {
        let mut same: BTreeMap<[u64; 3], usize> = BTreeMap::new();
        let id: Vec<usize> = self
            .points
            .iter()
            .enumerate()
            // adding 0 makes -0 and 0 the same
            .map(|(k, p)| *same.entry([p.x, p.y, p.z].map(|x| (x + 0.0).to_bits())).or_insert(k))
            .collect();
        let mut parent: Vec<usize> = (0..self.points.len()).collect();
        fn root(parent: &mut [usize], mut k: usize) -> usize {
            while parent[k] != k {
                parent[k] = parent[parent[k]];
                k = parent[k];
            }
            k
        }
        for f in &self.faces {
            let a = root(&mut parent, id[f[0]]);
            for corner in &f[1..] {
                let b = root(&mut parent, id[*corner]);
                let a = root(&mut parent, a);
                parent[a.max(b)] = a.min(b);
            }
        }
        let mut shells: BTreeMap<usize, Vec<V3>> = BTreeMap::new();
        let mut used = vec![false; self.points.len()];
        for corner in self.faces.iter().flatten().map(|c| id[*c]) {
            if !std::mem::replace(&mut used[corner], true) {
                shells.entry(root(&mut parent, corner)).or_default().push(self.points[corner]);
            }
        }
        shells.into_values().collect()
    }
}

fn parse(bytes: &[u8], name: &str) -> std::result::Result<Mesh, String> {
    let end = Path::new(name).extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    match end.as_str() {
        "stl" => stl(bytes),
        "obj" => obj(text(bytes)?),
        _ => Err(format!("found the ending '{end}', expected stl or obj")),
    }
}

fn text(bytes: &[u8]) -> std::result::Result<&str, String> {
    std::str::from_utf8(bytes).map_err(|_| "is not a text file".to_owned())
}

fn number(word: Option<&str>, line: usize) -> std::result::Result<f64, String> {
    let word = word.unwrap_or("nothing");
    word.parse::<f64>()
        .ok()
        .filter(|x| x.is_finite())
        .ok_or_else(|| format!("line {line}: found '{word}', expected a finite number"))
}

fn point<'a>(words: &mut impl Iterator<Item = &'a str>, line: usize) -> std::result::Result<V3, String> {
    Ok(V3::new(number(words.next(), line)?, number(words.next(), line)?, number(words.next(), line)?))
}

/// Binary files may begin with "solid", too: their length tells.
fn stl(bytes: &[u8]) -> std::result::Result<Mesh, String> {
    let count = bytes.get(80..84).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    let size = |n: u32| 84 + 50 * u64::from(n);
    if let Some(n) = count
        && size(n) == bytes.len() as u64
    {
        let mut points = Vec::new();
        for facet in bytes[84..].chunks_exact(50) {
            for corner in facet[12..48].chunks_exact(12) {
                let x = |k: usize| {
                    corner[4 * k..4 * k + 4].try_into().map_or(f64::NAN, |b| f64::from(f32::from_le_bytes(b)))
                };
                points.push(V3::new(x(0), x(1), x(2)));
            }
        }
        let faces = (0..points.len() / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        return Mesh::checked(points, faces);
    }
    if !bytes.trim_ascii_start().starts_with(b"solid") {
        return Err(match count {
            Some(n) => format!(
                "has {} bytes, expected {} for its {n} triangles, or a text that begins with 'solid'",
                bytes.len(),
                size(n)
            ),
            None => format!("has {} bytes, expected an STL file", bytes.len()),
        });
    }
    let mut points = Vec::new();
    let mut last = 0;
    let text = text(bytes)?;
    for (k, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        if words.next() == Some("vertex") {
            points.push(point(&mut words, k + 1)?);
        }
        last = k + 1;
    }
    if points.len() % 3 != 0 || !text.contains("endsolid") {
        return Err(format!(
            "ends at line {last} with {} vertices, expected three for each triangle and 'endsolid'",
            points.len()
        ));
    }
    let faces = (0..points.len() / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    Mesh::checked(points, faces)
}

fn obj(text: &str) -> std::result::Result<Mesh, String> {
    let mut points: Vec<V3> = Vec::new();
    let mut faces = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let line_number = k + 1;
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => points.push(point(&mut words, line_number)?),
            Some("f") => {
                let corners = words
                    .map(|w| {
                        let index = w.split('/').next().and_then(|i| i.parse::<i64>().ok()).unwrap_or(0);
                        // counted from 1, or backwards from the last vertex so far
                        let at = if index < 0 { i64::try_from(points.len()).unwrap_or(0) + index } else { index - 1 };
                        usize::try_from(at).ok().filter(|i| *i < points.len() && index != 0).ok_or_else(|| {
                            format!("line {line_number}: found vertex '{w}', expected one of 1 to {}", points.len())
                        })
                    })
                    .collect::<std::result::Result<Vec<usize>, String>>()?;
                if corners.len() < 3 {
                    return Err(format!(
                        "line {line_number}: found a face of {} corners, expected three or more",
                        corners.len()
                    ));
                }
                faces.extend((1..corners.len() - 1).map(|i| [corners[0], corners[i], corners[i + 1]]));
            }
            _ => {}
        }
    }
    Mesh::checked(points, faces)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

    use proptest::prelude::*;

    use super::*;

    /// Two cubes of 20 mm, 100 mm apart, as an OBJ of quads.
    fn cubes() -> String {
        let mut out = String::new();
        for x0 in [0.0, 100.0] {
            for k in 0..8 {
                let at = |bit: i32| if k & bit == 0 { 0.0 } else { 20.0 };
                out += &format!("v {} {} {}\n", x0 + at(1), at(2), at(4));
            }
        }
        for o in [0, 8] {
            for f in [[1, 2, 4, 3], [5, 6, 8, 7], [1, 2, 6, 5], [3, 4, 8, 7], [1, 3, 7, 5], [2, 4, 8, 6]] {
                out += &format!("f {}/1/1 {} {} {}\n", f[0] + o, f[1] + o, f[2] + o, f[3] + o);
            }
        }
        out
    }

    fn as_stl(mesh: &Mesh) -> (Vec<u8>, String) {
        let mut binary = vec![b' '; 80];
        binary.extend(u32::try_from(mesh.faces.len()).unwrap().to_le_bytes());
        let mut text = String::from("solid x\n");
        for f in &mesh.faces {
            binary.extend([0; 12]);
            text += "facet normal 0 0 0\nouter loop\n";
            for c in f {
                let p = mesh.points[*c];
                p.iter().for_each(|x| binary.extend((*x as f32).to_le_bytes()));
                text += &format!("vertex {} {} {}\n", p.x, p.y, p.z);
            }
            text += "endloop\nendfacet\n";
            binary.extend([0; 2]);
        }
        (binary, text + "endsolid x\n")
    }

    #[test]
    fn all_three_formats_say_the_same() {
        let o = parse(cubes().as_bytes(), "a.obj").unwrap();
        let (binary, text) = as_stl(&o);
        for mesh in [parse(&binary, "a.STL").unwrap(), parse(text.as_bytes(), "a.stl").unwrap()] {
            assert_eq!(mesh.faces.len(), 24);
            let shells = mesh.shells();
            assert_eq!(shells.len(), 2);
            assert!(shells.iter().all(|s| s.len() == 8));
            assert!(shells[0].iter().all(|p| p.x <= 20.0) && shells[1].iter().all(|p| p.x >= 100.0));
        }
    }

    #[test]
    fn a_hull_of_few_corners_contains_the_mesh() {
        // a ball of 5000 points
        let points: Vec<V3> = (0..5000)
            .map(|k| {
                let z = 1.0 - (2.0 * f64::from(k) + 1.0) / 5000.0;
                let (s, c) = (f64::from(k) * 2.4).sin_cos();
                V3::new((1.0 - z * z).sqrt() * c, (1.0 - z * z).sqrt() * s, z) * 50.0
            })
            .collect();
        let (corners, out) = few_corners(&points).unwrap();
        assert!(corners.len() <= CORNERS as usize && out > 0.0 && out < 6.0, "{out}");
        let list: Vec<DVec3> = corners.iter().map(|p| DVec3::new(p.x, p.y, p.z)).collect();
        let hull = ConvexPolyhedron::from_convex_hull(&list).unwrap();
        for p in &points {
            assert!(hull.distance_to_local_point(DVec3::new(p.x, p.y, p.z), true) <= out + 1e-9);
        }
    }

    #[test]
    fn bad_meshes_are_named() {
        let message = |bytes: &[u8], name: &str| parse(bytes, name).err().unwrap();
        let good = as_stl(&parse(cubes().as_bytes(), "a.obj").unwrap());
        assert!(message(&good.0[..good.0.len() - 7], "a.stl").contains("expected 1284 for its 24 triangles"));
        // cut off after the tenth vertex
        let cut = good.1.match_indices("vertex").nth(10).unwrap().0;
        assert!(
            message(&good.1.as_bytes()[..cut], "a.stl").contains("expected three for each triangle and 'endsolid'")
        );
        assert_eq!(message(b"v 1 2 x\n", "a.obj"), "line 1: found 'x', expected a finite number");
        assert_eq!(message(b"v 1 2 nan\n", "a.obj"), "line 1: found 'nan', expected a finite number");
        assert_eq!(message(b"v 1 2 3\nf 1 2 3\n", "a.obj"), "line 2: found vertex '2', expected one of 1 to 1");
        assert_eq!(message(b"v 1 2 3\nf 1 1\n", "a.obj"), "line 2: found a face of 2 corners, expected three or more");
        assert!(message(b"", "a.obj").contains("has no triangles"));
        assert!(message(b"", "a.stl").contains("has 0 bytes"));
        assert!(message(b"", "a.step").contains("found the ending 'step', expected stl or obj"));
        let flat = parse(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 3 4\n", "a.obj").unwrap();
        assert!(few_corners(&flat.points).unwrap_err().contains("4 points in one plane"));
        let far = few_corners(&[V3::new(3e5, 0.0, 0.0)]).unwrap_err();
        assert!(far.contains("unit_mm"), "{far}");
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), text in "[vf0-9/ .\n-]{0,200}") {
            let _ = parse(&bytes, "a.stl");
            let _ = parse(&bytes, "a.obj").map(|m| m.shells());
            let _ = parse(text.as_bytes(), "a.obj").map(|m| m.shells());
            let _ = parse(format!("solid\n{text}endsolid").as_bytes(), "a.stl");
        }
    }
}
