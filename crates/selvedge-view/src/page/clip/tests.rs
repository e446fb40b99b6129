//! Clips are read back with the crate that wrote them: size, count, clock, pixels.

use super::*;
use glam::Vec3;
use selvedge_cloth::Topology;

const SETTINGS: ClipSettings = ClipSettings {
    view: View {
        azimuth: 142.0,
        elevation: 14.0,
    },
    tile: [48, 40],
};

/// A triangle that moves sideways and, in the second half, stands still.
fn frames(count: usize) -> Vec<[Vec3; 3]> {
    (0..count)
        .map(|frame| {
            let moved = frame.min(count / 2) as f32 / count as f32;
            [[0.0, 0.0], [0.0, 1.0], [1.0, 0.5]].map(|[z, y]| Vec3::new(0.1 * z, y, z + moved))
        })
        .collect()
}

/// Calls `with` with the run of so many frames of the triangle.
fn on_run<T>(count: usize, rate: f64, with: impl FnOnce(&Run<'_>) -> T) -> T {
    let topology = Topology::new(3, &[[0, 1, 2]]).unwrap();
    let frames = frames(count);
    let frames = frames.iter().map(<[Vec3; 3]>::as_slice);
    with(&Run::new(&topology, frames, &[], rate).unwrap())
}

fn panel<'a>(label: &'a str, run: &'a Run<'a>) -> Panel<'a> {
    let plain = Panel::of(run);
    Panel { label, ..plain }
}

/// What is said where a clip cannot be written.
fn refused(panels: &[Panel<'_>], settings: ClipSettings) -> String {
    let end = write_clip(&mut Vec::new(), "", panels, &settings, &mut || {
        ControlFlow::Continue(())
    });
    end.unwrap_err().to_string()
}

/// The pictures of a GIF as numbers of its palette, with their delays.
struct Played {
    palette: Vec<u8>,
    size: [usize; 2],
    delays: Vec<u16>,
    areas: Vec<usize>,
    pictures: Vec<Vec<u8>>,
    repeat: gif::Repeat,
}

fn play(bytes: &[u8]) -> Played {
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::Indexed);
    options.check_frame_consistency(true);
    let mut decoder = options.read_info(bytes).unwrap();
    let size = [decoder.width(), decoder.height()].map(usize::from);
    let mut played = Played {
        palette: decoder.global_palette().unwrap().to_vec(),
        size,
        delays: Vec::new(),
        areas: Vec::new(),
        pictures: Vec::new(),
        repeat: gif::Repeat::Finite(1),
    };
    let mut screen = vec![UNCHANGED; size[0] * size[1]];
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        assert_eq!(frame.transparent, Some(UNCHANGED));
        let width = usize::from(frame.width);
        for (at, &number) in frame.buffer.iter().enumerate() {
            let row = usize::from(frame.top) + at / width;
            let column = usize::from(frame.left) + at % width;
            if number != UNCHANGED {
                screen[row * size[0] + column] = number;
            }
        }
        played.delays.push(frame.delay);
        played.areas.push(frame.buffer.len());
        played.pictures.push(screen.clone());
    }
    played.repeat = decoder.repeat();
    played
}

fn clip(panels: &[Panel<'_>], settings: &ClipSettings) -> Vec<u8> {
    let mut bytes = Vec::new();
    let end = write_clip(&mut bytes, "Title", panels, settings, &mut || {
        ControlFlow::Continue(())
    });
    assert_eq!(end.unwrap(), ControlFlow::Continue(()));
    bytes
}

#[test]
fn a_clip_lasts_as_long_as_its_run() {
    // 3 s at 60 and at 24 frames per second.
    for (rate, count) in [(60.0, 181), (24.0, 73)] {
        let bytes = on_run(count, rate, |run| clip(&[panel("one", run)], &SETTINGS));
        let played = play(&bytes);
        // Pictures at 0, d, 2 d, ... 3 s.
        assert_eq!(played.pictures.len(), 61);
        assert!(played.delays.iter().all(|&delay| delay == 5));
        assert_eq!(played.repeat, gif::Repeat::Infinite);
    }
}

#[test]
fn frames_are_those_nearest_to_each_moment() {
    // 48 frames per second every 50 ms: 0, 2.4, 4.8, 7.2, 9.6, 12, ...
    let found = on_run(25, 48.0, |run| frames_at(run).unwrap());
    assert_eq!(found, [0, 2, 5, 7, 10, 12, 14, 17, 19, 22, 24]);
}

#[test]
fn decoded_pixels_are_the_pictures_within_the_tolerance() {
    on_run(31, 60.0, |run| {
        let panels = ["truth", "prediction"].map(|label| panel(label, run));
        let played = play(&clip(&panels, &SETTINGS));
        let mut studio = Studio::new("Title", &panels, &SETTINGS).unwrap();
        let numbers = frames_at(run).unwrap();
        let mut palette = studio.palette(&numbers).unwrap();
        assert_eq!(played.palette[..palette.table().len()], palette.table());
        assert_eq!(played.size, studio.size().map(usize::from));
        for (picture, &frame) in played.pictures.iter().zip(&numbers) {
            let original = studio.picture(frame).unwrap();
            for (&number, &colour) in picture.iter().zip(original.pixels()) {
                let shown = palette.colour(number).unwrap();
                let best = palette.number(colour);
                assert!(number == best || distance_squared(shown, colour) <= TOLERANCE);
            }
        }
    });
}

#[test]
fn what_stands_still_costs_nothing_but_its_clock() {
    let played = play(&on_run(61, 60.0, |run| clip(&[panel("", run)], &SETTINGS)));
    let whole = played.size[0] * played.size[1];
    assert_eq!(played.areas[0], whole);
    // The last quarter shows the running time only: less than an eighth of the picture.
    assert!(played.areas[16..].iter().all(|&area| 8 * area < whole));
}

#[test]
fn a_stopped_clip_is_whole() {
    let (mut bytes, mut written) = (Vec::new(), 0);
    let mut stop = || {
        written += 1;
        match written {
            3 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    };
    let end = on_run(61, 60.0, |run| {
        write_clip(&mut bytes, "", &[panel("", run)], &SETTINGS, &mut stop)
    });
    assert_eq!(end.unwrap(), ControlFlow::Break(()));
    assert_eq!(play(&bytes).pictures.len(), 3);
    assert_eq!(bytes.last(), Some(&0x3b), "the trailer of a GIF");
}

#[test]
fn settings_out_of_range_are_errors_that_name_them() {
    let of = |tile| ClipSettings { tile, ..SETTINGS };
    on_run(3, 60.0, |run| {
        let panels = [panel("", run); 3];
        for (count, settings, words) in [
            (
                1,
                of([0, 40]),
                "tile is 0 x 40 pixels: both must be between 1 and 65535",
            ),
            (0, SETTINGS, "at least one run"),
            (3, of([40_000, 40]), "page is 120"),
        ] {
            let text = refused(&panels[..count], settings);
            assert!(text.contains(words), "{text}");
        }
    });
    // A run whose frames hardly pass.
    for rate in [1e-9, 1e-17, 1e-300] {
        let text = on_run(2, rate, |run| refused(&[panel("", run)], SETTINGS));
        let words = "the clip must be of at most 1000000 pictures";
        assert!(text.starts_with(words), "{text}");
    }
}

#[test]
fn a_writer_that_fails_is_an_error() {
    struct Full;
    impl Write for Full {
        fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
            Err(std::io::Error::other("disk full"))
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let end = on_run(3, 60.0, |run| {
        write_clip(&mut Full, "", &[panel("", run)], &SETTINGS, &mut || {
            ControlFlow::Continue(())
        })
    });
    let message = end.unwrap_err().to_string();
    assert_eq!(message, "the GIF clip could not be written: disk full");
}
