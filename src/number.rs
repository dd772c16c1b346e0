//! Numbers in sentences, and bytes in digits.

use std::fmt;

/// A number as people write it: very large and very small ones with an exponent, not with hundreds of digits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Brief(pub(crate) f64);

impl fmt::Display for Brief {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(value) = self;
        let size = value.abs();
        if value.is_finite() && size != 0.0 && !(1e-6..1e12).contains(&size) {
            write!(f, "{value:e}")
        } else {
            write!(f, "{value}")
        }
    }
}

/// Bytes in hexadecimal digits.
pub(crate) fn hex(bytes: &[u8]) -> String {
    use fmt::Write as _;
    let text = String::with_capacity(2 * bytes.len());
    bytes.iter().fold(text, |mut text, byte| {
        let _ = write!(text, "{byte:02x}"); // writing to a string cannot fail
        text
    })
}

#[cfg(test)]
mod tests {
    use super::Brief;

    #[test]
    fn only_extreme_numbers_have_an_exponent() {
        let shown = |v: f64| Brief(v).to_string();
        assert_eq!(shown(0.0), "0");
        assert_eq!(shown(-0.25), "-0.25");
        assert_eq!(shown(1e9), "1000000000");
        assert_eq!(shown(1e300), "1e300");
        assert_eq!(shown(-2.5e-9), "-2.5e-9");
        assert_eq!(shown(f64::INFINITY), "inf");
        assert_eq!(shown(f64::NAN), "NaN");
    }
}
