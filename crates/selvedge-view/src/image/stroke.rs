//! Strokes of even width with round ends: letters and the lines of plots.
//!
//! The cover of a pixel is the depth of its middle inside the stroke, width/2 + ½ - distance,
//! clamped to [0, 1]. Where pieces of a stroke meet, the larger cover counts.

use glam::Vec2;

use crate::{Image, Rgb};

/// A straight piece of a stroke [pixels].
pub(crate) type Segment = [Vec2; 2];

/// Draws `segments` as one stroke; what lies outside the image is cut off.
pub(crate) fn stroke(image: &mut Image, segments: &[Segment], width: f32, colour: Rgb) {
    let Some(&[first, _]) = segments.first() else {
        return;
    };
    let half_width = 0.5 * width;
    let reach = Vec2::splat(half_width + 0.5);
    let edge = Vec2::new(image.width() as f32, image.height() as f32);
    let inside = |p: Vec2| p.clamp(Vec2::ZERO, edge);
    let (low, high) = segments
        .iter()
        .flatten()
        .fold((first, first), |(low, high), &p| (low.min(p), high.max(p)));
    let (low, high) = (inside(low - reach).floor(), inside(high + reach).ceil());
    let (columns, rows) = ((high.x - low.x) as usize, (high.y - low.y) as usize);
    let mut covers = vec![0.0_f32; columns * rows];
    for segment in segments {
        let [start, end] = *segment;
        let from = inside(start.min(end) - reach).floor() - low;
        let to = inside(start.max(end) + reach).ceil() - low;
        for row in from.y as usize..to.y as usize {
            for column in from.x as usize..to.x as usize {
                let middle = low + Vec2::new(column as f32, row as f32) + 0.5;
                let distance = distance_squared(middle, segment).sqrt();
                let cover = (half_width + 0.5 - distance).clamp(0.0, 1.0);
                let here = &mut covers[row * columns + column];
                *here = here.max(cover);
            }
        }
    }
    for (at, &cover) in covers.iter().enumerate() {
        let (x, y) = (at % columns.max(1), at / columns.max(1));
        image.blend(
            low.x as i32 + x as i32,
            low.y as i32 + y as i32,
            colour,
            cover,
        );
    }
}

/// The pieces between points in a row.
pub(crate) fn between(points: &[Vec2]) -> impl Iterator<Item = Segment> + '_ {
    points.windows(2).map(|pair| [pair[0], pair[1]])
}

fn distance_squared(point: Vec2, segment: &Segment) -> f32 {
    let [start, end] = segment;
    let along = *end - *start;
    let length_squared = along.length_squared();
    let share = if length_squared > 0.0 {
        ((point - *start).dot(along) / length_squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    point.distance_squared(*start + share * along)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bent_line_covers_its_pieces_once_and_stays_inside() {
        let mut image = Image::filled(20, 20, [255; 3]).unwrap();
        // Along the row below y = 10 to x = 10, then down and out of the image.
        let points = [[-5.0, 10.5], [10.5, 10.5], [10.5, 90.0]].map(Vec2::from_array);
        let segments: Vec<Segment> = between(&points).collect();
        stroke(&mut image, &segments, 1.0, [0; 3]);
        for k in 0..20 {
            let along = if k <= 10 { 0 } else { 255 };
            let down = if k >= 10 { 0 } else { 255 };
            assert_eq!(image.pixel(k, 10), Some([along; 3]), "{k}");
            assert_eq!(image.pixel(10, k), Some([down; 3]), "{k}");
        }
        assert_eq!(image.pixel(5, 5), Some([255; 3]));
    }
}
