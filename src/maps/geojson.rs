//! Maps in GeoJSON (RFC 7946): regions, obstacles, bounds and start as features.

use nalgebra::Point2;
use serde_json::Value;

use super::outline::Rings;
use super::{MapErrorKind, MapOptions, Units};
use crate::ltl::bad_name;
use crate::workspace::{Bounds, Polygon};

/// Mean radius of the Earth, metres.
const RADIUS: f64 = 6_371_008.8;

/// No robot's map in degrees is larger, in kilometres: two degrees of latitude.
const LARGEST_KM: f64 = 222.0;

/// What a GeoJSON file holds, in metres.
#[derive(Debug, Default)]
pub(super) struct Features {
    pub(super) regions: Vec<(String, Vec<Point2<f64>>)>,
    /// Each with its name, which may be empty.
    pub(super) obstacles: Vec<(String, Rings)>,
    pub(super) bounds: Option<Rings>,
    pub(super) start: Option<Point2<f64>>,
}

/// A feature's `properties.kind`.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Region,
    Obstacle,
    Bounds,
    Start,
}

type Fault = MapErrorKind;

fn fault(what: &str, message: impl std::fmt::Display) -> Fault {
    MapErrorKind::Syntax(format!("{what}: {message}"))
}

/// Reads a file; `Err` with the line where there is one.
pub(super) fn read(text: &str, options: &MapOptions) -> Result<Features, (Option<usize>, Fault)> {
    let value: Value = serde_json::from_str(text).map_err(|e| {
        let message = e.to_string();
        let message = message.split(" at line ").next().unwrap_or_default();
        (Some(e.line()), MapErrorKind::Syntax(message.to_owned()))
    })?;
    features(&value, options).map_err(|e| (None, e))
}

fn features(value: &Value, options: &MapOptions) -> Result<Features, Fault> {
    let list = match kind_of(value) {
        Some("FeatureCollection") => {
            value["features"]
                .as_array()
                .ok_or_else(|| MapErrorKind::Field {
                    field: "features".to_owned(),
                    problem: "should be an array of features".to_owned(),
                })?
        }
        Some("Feature") => std::slice::from_ref(value),
        other => {
            let found = other.unwrap_or("nothing");
            let message = format!(
                "expected a FeatureCollection or a Feature, whose properties say what it is, found {found}"
            );
            return Err(fault("`type`", message));
        }
    };
    let units = match (options.units, &value["units"]) {
        (Some(units), _) => units,
        (None, Value::Null) => Units::Degrees,
        (None, found) if found == "m" => Units::Metres,
        (None, found) => {
            let message = format!("is {found}: expected \"m\", or nothing for degrees");
            return Err(fault("`units`", message));
        }
    };
    let mut all = Features::default();
    let mut others = Vec::new();
    for (i, feature) in list.iter().enumerate() {
        if !feature["properties"]["kind"].is_null() {
            add(&mut all, i, feature, units)?;
        } else if let Some("Polygon" | "MultiPolygon") = kind_of(&feature["geometry"]) {
            // Maps show more than concerns a robot, but this could have been meant.
            others.push(called(i, feature));
        }
    }
    if let [first, rest @ ..] = &others[..] {
        let more = match rest.len() {
            0 => String::new(),
            n => format!(" and {n} more"),
        };
        let kinds = "region, obstacle, bounds or start";
        log::warn!("left out of the map: {first}{more}, whose properties have no `kind` ({kinds})");
    }
    if units == Units::Degrees {
        project(&mut all, options)?;
        doubt(&all);
    }
    Ok(all)
}

fn kind_of(value: &Value) -> Option<&str> {
    value["type"].as_str()
}

fn name_of(feature: &Value) -> &str {
    feature["properties"]["name"].as_str().unwrap_or_default()
}

/// What to call a feature in messages.
fn called(i: usize, feature: &Value) -> String {
    match name_of(feature) {
        "" => format!("feature {}", i + 1),
        name => format!("feature {} (`{name}`)", i + 1),
    }
}

fn add(all: &mut Features, i: usize, feature: &Value, units: Units) -> Result<(), Fault> {
    let properties = &feature["properties"];
    let (name, what) = (name_of(feature), called(i, feature));
    let kind = match properties["kind"].as_str() {
        Some("region") => Kind::Region,
        Some("obstacle") => Kind::Obstacle,
        Some("bounds") => Kind::Bounds,
        Some("start") => Kind::Start,
        other => {
            let found = other.map_or_else(|| properties["kind"].to_string(), str::to_owned);
            let message =
                format!("its `kind` is `{found}`: expected region, obstacle, bounds or start");
            return Err(fault(&what, message));
        }
    };
    let geometry = &feature["geometry"];
    if kind == Kind::Start {
        if kind_of(geometry) != Some("Point") {
            return Err(fault(&what, "a start should be a Point"));
        }
        let at = position(&geometry["coordinates"], units).map_err(|e| fault(&what, e))?;
        if all.start.replace(at).is_some() {
            return Err(fault(&what, "there is a start already"));
        }
        return Ok(());
    }
    let mut polygons = Vec::new();
    collect(geometry, units, 0, &mut polygons).map_err(|e| fault(&what, e))?;
    for rings in &polygons {
        check(rings, &what)?;
    }
    match kind {
        Kind::Obstacle => {
            let named = polygons.into_iter().map(|rings| (name.to_owned(), rings));
            all.obstacles.extend(named);
        }
        Kind::Region => {
            let [rings] = <[Rings; 1]>::try_from(polygons).map_err(|found| {
                let found = found.len();
                let hint = "a region is one polygon: give each part a name of its own";
                fault(&what, format!("it has {found} polygons; {hint}"))
            })?;
            if rings.len() > 1 {
                let message = "a region has no holes: cut it into regions without";
                return Err(fault(&what, message));
            }
            if name.is_empty() {
                return Err(fault(&what, "a region needs a `name` in its properties"));
            }
            if let Some(reason) = bad_name(name) {
                let message = format!("its name cannot name a region: {reason}");
                return Err(fault(&what, message));
            }
            let outer = rings.into_iter().next().unwrap_or_default();
            all.regions.push((name.to_owned(), outer));
        }
        _ => {
            let [rings] = <[Rings; 1]>::try_from(polygons)
                .map_err(|_| fault(&what, "bounds should be one polygon"))?;
            if rings.len() > 1 {
                return Err(fault(&what, "bounds have no holes: use obstacles"));
            }
            if all.bounds.replace(rings).is_some() {
                return Err(fault(&what, "there are bounds already"));
            }
        }
    }
    Ok(())
}

/// The polygons of a geometry.
fn collect(
    geometry: &Value,
    units: Units,
    depth: usize,
    into: &mut Vec<Rings>,
) -> Result<(), String> {
    let coordinates = &geometry["coordinates"];
    let list = |value: &Value, what: &str| -> Result<Vec<Value>, String> {
        let list = value.as_array().cloned();
        list.ok_or_else(|| format!("expected {what} as an array"))
    };
    match kind_of(geometry) {
        Some("Polygon") => into.push(rings(coordinates, units)?),
        Some("MultiPolygon") => {
            for polygon in &list(coordinates, "the polygons")? {
                into.push(rings(polygon, units)?);
            }
        }
        Some("GeometryCollection") if depth < 16 => {
            for part in &list(&geometry["geometries"], "`geometries`")? {
                collect(part, units, depth + 1, into)?;
            }
        }
        Some(other) => {
            return Err(format!(
                "its geometry is a {other}: expected a Polygon or a MultiPolygon"
            ));
        }
        None => return Err("it has no geometry".to_owned()),
    }
    Ok(())
}

fn rings(coordinates: &Value, units: Units) -> Result<Rings, String> {
    let rings = coordinates
        .as_array()
        .filter(|rings| !rings.is_empty())
        .ok_or("expected a polygon's rings as an array")?;
    let ring = |(k, ring): (usize, &Value)| {
        let positions = ring
            .as_array()
            .filter(|p| p.len() >= 4)
            .ok_or_else(|| format!("ring {} should have at least four positions", k + 1))?;
        let points = positions.iter().map(|p| position(p, units));
        let mut points: Vec<Point2<f64>> = points.collect::<Result<_, _>>()?;
        if points.first() != points.last() {
            return Err(format!(
                "ring {} is not closed: its last position should equal its first",
                k + 1
            ));
        }
        points.pop();
        Ok(points)
    };
    rings.iter().enumerate().map(ring).collect()
}

fn position(value: &Value, units: Units) -> Result<Point2<f64>, String> {
    let number = |i: usize| value.get(i).and_then(Value::as_f64);
    let (Some(x), Some(y)) = (number(0), number(1)) else {
        return Err("expected a position as [x, y]".to_owned());
    };
    if units == Units::Degrees && (x.abs() > 180.0 || y.abs() > 90.0) {
        return Err(format!(
            "[{x}, {y}] is no longitude and latitude: for metres, add `\"units\": \"m\"` at the top"
        ));
    }
    Ok(Point2::new(x + 0.0, y + 0.0))
}

/// Whether every ring is a simple polygon, and holes lie within the outer one, apart.
fn check(rings: &Rings, what: &str) -> Result<(), Fault> {
    let mut polygons = Vec::with_capacity(rings.len());
    for (k, ring) in rings.iter().enumerate() {
        let polygon = Polygon::new(ring.clone()).map_err(|source| MapErrorKind::Polygon {
            what: match k {
                0 => what.to_owned(),
                k => format!("{what}, hole {k}"),
            },
            source,
        })?;
        polygons.push(polygon);
    }
    if let Some((k, l)) = super::meeting_rings(rings) {
        let message = format!("rings {} and {} meet", k + 1, l + 1);
        return Err(fault(what, message));
    }
    let (outer, holes) = (&polygons[0], &polygons[1..]);
    let within = |outer: &Polygon, hole: &Polygon| {
        outer.side_of(hole.vertices()[0], 0.0) == crate::workspace::Side::Inside
    };
    for (k, hole) in holes.iter().enumerate() {
        if !within(outer, hole) {
            return Err(fault(what, format!("hole {} lies outside", k + 1)));
        }
        if holes.iter().any(|other| within(other, hole)) {
            return Err(fault(what, format!("hole {} lies in another", k + 1)));
        }
    }
    Ok(())
}

/// Longitude and latitude to metres around a reference point (equirectangular).
fn project(all: &mut Features, options: &MapOptions) -> Result<(), Fault> {
    let reference = match options.reference {
        Some([lon, lat]) => Point2::new(lon, lat),
        None => match extent(all) {
            Some(bounds) => nalgebra::center(&bounds.min, &bounds.max),
            None => return Ok(()),
        },
    };
    if !(reference.x.abs() <= 180.0 && reference.y.abs() <= 90.0) {
        return Err(MapErrorKind::Setting {
            setting: "reference",
            problem: "should be [longitude, latitude] in degrees".to_owned(),
        });
    }
    let across = RADIUS * libm::cos(reference.y.to_radians());
    let to_metres = |p: &mut Point2<f64>| {
        *p = Point2::new(
            across * (p.x - reference.x).to_radians(),
            RADIUS * (p.y - reference.y).to_radians(),
        );
    };
    let obstacles = all.obstacles.iter_mut().flat_map(|(_, rings)| rings);
    let bounds = all.bounds.iter_mut().flatten();
    let regions = all.regions.iter_mut().map(|(_, ring)| ring);
    let rings = obstacles.chain(bounds).chain(regions);
    rings.flatten().chain(&mut all.start).for_each(to_metres);
    Ok(())
}

/// Says so where the map is so large that its numbers are rather metres than degrees. The units are what the file says all the same.
fn doubt(all: &Features) {
    let Some(bounds) = extent(all) else { return };
    let side = (bounds.max - bounds.min).max() / 1000.0;
    if side > LARGEST_KM {
        log::warn!(
            "the map is {side:.0} km across, as its coordinates are read as degrees: for metres, add `\"units\": \"m\"` to the GeoJSON file"
        );
    }
}

/// The bounding box of everything; `None` if there is nothing.
pub(super) fn extent(all: &Features) -> Option<Bounds> {
    let obstacles = all.obstacles.iter().flat_map(|(_, rings)| rings);
    let regions = all.regions.iter().map(|(_, ring)| ring);
    let rings = obstacles.chain(all.bounds.iter().flatten()).chain(regions);
    let mut points = rings.flatten().chain(&all.start);
    let first = *points.next()?;
    let (min, max) = points.fold((first, first), |(min, max), p| (min.inf(p), max.sup(p)));
    Some(Bounds { min, max })
}
