//! Lines that are put together from every so-many-th value, and taken apart.

/// `line[n · ways + k] = source(k)[n]`.
#[inline(always)]
pub(super) fn interleave<'a>(line: &mut [f32], ways: usize, source: impl Fn(usize) -> &'a [f32]) {
    match ways {
        2 => pieces::<2>(line, source),
        4 => pieces::<4>(line, source),
        _ => {
            for k in 0..ways.min(line.len()) {
                let to = line[k..].iter_mut().step_by(ways);
                to.zip(source(k)).for_each(|(to, &v)| *to = v);
            }
        }
    }
}

/// As [`interleave`], by whole pieces of a value of each source: compilers make vectors of these.
#[inline(always)]
fn pieces<'a, const WAYS: usize>(line: &mut [f32], source: impl Fn(usize) -> &'a [f32]) {
    let (pieces, rest) = line.as_chunks_mut::<WAYS>();
    let count = pieces.len();
    // Sources without a value are those of no piece.
    let sources: [&[f32]; WAYS] = std::array::from_fn(|k| if count > 0 { source(k) } else { &[] });
    let whole = sources.map(|source| &source[..count]);
    for (n, piece) in pieces.iter_mut().enumerate() {
        *piece = std::array::from_fn(|k| whole[k][n]);
    }
    for (k, to) in rest.iter_mut().enumerate() {
        *to = source(k)[count];
    }
}

/// The opposite: `parts` gets every `WAYS`-th value, from the first on, from the second on, and so on; the part k begins at `k · room`.
#[inline(always)]
pub(super) fn take_apart<const WAYS: usize>(line: &[f32], parts: &mut [f32], room: usize) {
    let (pieces, rest) = line.as_chunks::<WAYS>();
    debug_assert!(rest.is_empty(), "whole pieces");
    let mut parts = parts.chunks_exact_mut(room.max(1));
    let mut parts: [&mut [f32]; WAYS] =
        std::array::from_fn(|_| &mut parts.next().expect("a part for each")[..pieces.len()]);
    for (n, piece) in pieces.iter().enumerate() {
        for (part, &value) in parts.iter_mut().zip(piece) {
            part[n] = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{interleave, take_apart};

    #[test]
    fn what_is_taken_apart_fits_together() {
        let line: Vec<f32> = (0..36).map(|v| v as f32).collect();
        let (room, mut parts) = (11, vec![f32::NAN; 44]);
        take_apart::<4>(&line, &mut parts, room);
        let mut again = vec![f32::NAN; 36];
        interleave(&mut again, 4, |k| &parts[k * room..][..9]);
        assert_eq!(again, line);
    }

    #[test]
    fn every_value_finds_its_place() {
        for ways in 1..6 {
            for len in 0..40 {
                let value = |at: usize| (at * 7 + 3) as f32;
                let sources: Vec<Vec<f32>> = (0..ways)
                    .map(|k| (k..len).step_by(ways).map(value).collect())
                    .collect();
                let mut line = vec![f32::NAN; len];
                interleave(&mut line, ways, |k| &sources[k]);
                let expected: Vec<f32> = (0..len).map(value).collect();
                assert_eq!(line, expected, "{ways} {len}");
            }
        }
    }
}
