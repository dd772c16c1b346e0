//! Points in scenario files: two coordinates, neither fewer nor more.

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};

/// A point.
struct Pair([f64; 2]);

impl<'de> Deserialize<'de> for Pair {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let point = deserializer.deserialize_seq(Numbers("a point [x, y]"))?;
        Ok(Self(point))
    }
}

/// One of the two points that are bounds.
struct Corner([f64; 2]);

impl<'de> Deserialize<'de> for Corner {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let expected = "a point: bounds are two, [[left, bottom], [right, top]]";
        Ok(Self(deserializer.deserialize_seq(Numbers(expected))?))
    }
}

/// Reads two numbers, and says what else was expected. Some formats fill an array of two from a longer
/// list and forget the rest.
struct Numbers(&'static str);

impl<'de> Visitor<'de> for Numbers {
    type Value = [f64; 2];

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<[f64; 2], A::Error> {
        let mut numbers = Vec::new();
        while let Some(number) = items.next_element()? {
            numbers.push(number);
        }
        let found = numbers.len();
        numbers.try_into().map_err(|_| {
            A::Error::custom(format_args!(
                "{found} numbers where a point [x, y] has two: maps are flat, and headings are not modelled"
            ))
        })
    }
}

pub(super) fn one<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 2], D::Error> {
    Ok(Pair::deserialize(deserializer)?.0)
}

pub(super) fn maybe<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<[f64; 2]>, D::Error> {
    Ok(Option::<Pair>::deserialize(deserializer)?.map(|p| p.0))
}

pub(super) fn corners<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<[[f64; 2]; 2], D::Error> {
    let found = Vec::<Corner>::deserialize(deserializer)?;
    let count = found.len();
    let found: Vec<[f64; 2]> = found.into_iter().map(|c| c.0).collect();
    found.try_into().map_err(|_| {
        D::Error::custom(format_args!(
            "{count} points where bounds have two, the lower left corner and the upper right one"
        ))
    })
}

pub(super) fn maybe_corners<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<[[f64; 2]; 2]>, D::Error> {
    corners(deserializer).map(Some)
}

pub(super) fn polygons<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<Vec<[f64; 2]>>, D::Error> {
    let found = Vec::<Vertices>::deserialize(deserializer)?;
    Ok(found.into_iter().map(|v| v.0).collect())
}

/// The vertices of a polygon.
pub(super) struct Vertices(pub(super) Vec<[f64; 2]>);

impl<'de> Deserialize<'de> for Vertices {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let found = Vec::<Pair>::deserialize(deserializer)?;
        Ok(Self(found.into_iter().map(|p| p.0).collect()))
    }
}
