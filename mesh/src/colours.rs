//! Vertex and face colours as files have them: bytes, 16 bits, or real numbers up to 1 or 255.

/// The sRGB colour of places of which none is known, beside others of known colour.
pub(super) const UNKNOWN_COLOUR: [u8; 3] = [128; 3];

/// Real numbers up to this are taken to end at 1: some programs overshoot, but none stops at 2 of 255.
const LARGEST_UNIT: f32 = 2.0;

/// Colours (n) whose channels end at 1, 255 or 65535, whichever holds the largest of them, in bytes.
///
/// `None` for a colour that is none: not a number, negative, or beyond all of these.
pub(super) fn byte_colours(colours: &[[f32; 3]], are_integers: bool) -> Vec<Option<[u8; 3]>> {
    let channels = colours.iter().flatten().copied();
    let largest = channels.filter(|channel| channel.is_finite()).fold(0.0, f32::max);
    let end = match largest {
        _ if largest <= LARGEST_UNIT && !are_integers => 1.0,
        _ if largest < 255.5 => 255.0,
        _ => 65535.0,
    };
    let byte = |channel: f32| {
        let share = channel / end;
        // Rounding of other programs passes either end.
        (-0.01..=LARGEST_UNIT).contains(&share).then(|| (share.clamp(0.0, 1.0) * 255.0).round() as u8)
    };
    colours.iter().map(|&[r, g, b]| Some([byte(r)?, byte(g)?, byte(b)?])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_channel_tells_where_channels_end() {
        let colour = Some([200, 60, 20]);
        let bytes = [200.0, 60.0, 20.0];
        assert_eq!(byte_colours(&[bytes], true), [colour]);
        assert_eq!(byte_colours(&[bytes], false), [colour]);
        assert_eq!(byte_colours(&[bytes.map(|channel| channel / 255.0)], false), [colour]);
        assert_eq!(byte_colours(&[bytes.map(|channel| channel * 257.0)], true), [colour]);
        assert_eq!(byte_colours(&[[1.0, 0.0, 0.0]], true), [Some([1, 0, 0])], "bytes, and dark");
        assert_eq!(byte_colours(&[[1.02, 0.5, -1e-6]], false), [Some([255, 128, 0])], "overshoots");
    }

    #[test]
    fn what_is_no_colour_leaves_the_others_alone() {
        let colours = [[0.5, 0.5, 0.5], [f32::NAN, 0.0, 0.0], [0.0, f32::INFINITY, 0.0], [-1.0, 0.0, 0.0]];
        assert_eq!(byte_colours(&colours, false), [Some([128; 3]), None, None, None]);
        assert_eq!(byte_colours(&[[1e9, 0.0, 0.0]], false), [None]);
        assert_eq!(byte_colours(&[], false), []);
    }
}
