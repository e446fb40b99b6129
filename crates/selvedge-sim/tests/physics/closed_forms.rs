//! The error in space: closed forms on regular and irregular meshes of three finenesses.
#![allow(clippy::print_stdout, reason = "the table of the book")]

use std::f64::consts::FRAC_PI_2;

use glam::{DVec2, DVec3, Vec2};
use selvedge_cloth::generate::{Shape, SheetSpec, sheet};
use selvedge_cloth::{Drape, HandleTargets, Handles, Material, Mesh, Scene, Stepper, StretchTable};
use selvedge_sim::{Simulator, sag};

use crate::scenes::{DENIM, material};
use crate::sheets::{elastic, grid, isotropic, scene};

const GRAVITY: f64 = 9.8;
/// Edge lengths of the meshes `[m]`; the first is a default one.
const SPACINGS: [f64; 3] = [0.015, 0.01, 0.007];

/// An irregular rectangle `[m]` of about this spacing, flat, its upper edge along v = 0.
fn irregular(width: f64, height: f64, spacing: f64, seed: u64) -> (Vec<DVec2>, Vec<[u32; 3]>) {
    let (inner, edge) = (
        1.07 * width * height / spacing.powi(2),
        (width + height) / spacing,
    );
    let spec = SheetSpec {
        shape: Shape::Rectangle,
        vertices: (inner + edge).round() as usize,
        size: height,
        width: Some(width),
        seed,
    };
    let mesh = sheet(&spec).unwrap().mesh;
    let below = |p: &DVec2| DVec2::new(p.x, p.y - height);
    let points = mesh.material_coordinates().iter().map(below).collect();
    (points, mesh.topology().face_indices())
}

/// The rectangle and its mirror image beyond the upper edge, placed by `place`, and the vertices of
/// that edge.
fn doubled(
    (mut points, mut faces): (Vec<DVec2>, Vec<[u32; 3]>),
    place: impl Fn(DVec2) -> DVec3,
) -> (Mesh, Vec<u32>) {
    let on_edge = |p: &DVec2| p.y.abs() < 1e-9;
    let edge: Vec<u32> = (0..)
        .zip(&points)
        .filter(|(_, p)| on_edge(p))
        .map(|(v, _)| v)
        .collect();
    let mut image: Vec<u32> = Vec::new();
    for (v, p) in points.clone().iter().enumerate() {
        if on_edge(p) {
            image.push(v as u32);
        } else {
            image.push(points.len() as u32);
            points.push(DVec2::new(p.x, -p.y));
        }
    }
    let mirrored = |face: &[u32; 3]| face.map(|v| image[v as usize]);
    let images: Vec<[u32; 3]> = faces
        .iter()
        .map(mirrored)
        .map(|[a, b, c]| [a, c, b])
        .collect();
    faces.extend(images);
    let positions = points.iter().map(|p| place(*p)).collect();
    (Mesh::new(&faces, points, positions).unwrap(), edge)
}

/// Squares with alternating diagonals, like [`irregular`].
fn regular(width: f64, height: f64, spacing: f64) -> (Vec<DVec2>, Vec<[u32; 3]>) {
    let [columns, rows] = [width, height].map(|side| (side / spacing).round() as usize);
    let mesh = grid(columns, rows, height / rows as f64, |_| DVec3::ZERO);
    let scale = DVec2::new(width * rows as f64 / (height * columns as f64), 1.0);
    let points = mesh.material_coordinates().iter();
    let points = points
        .map(|p| (*p - DVec2::new(0.0, height)) * scale)
        .collect();
    (points, mesh.topology().face_indices())
}

/// Energy of a sheet bent to the curvatures `along` and `across` (of a direction from u), over that
/// of a plate without Poisson's ratio.
fn bending(
    (points, faces): &(Vec<DVec2>, Vec<[u32; 3]>),
    degrees: f64,
    [along, across]: [f64; 2],
    even: bool,
) -> f64 {
    // So flat that nothing stretches.
    const FLAT: f64 = 1e-4;
    let sheet = elastic(2e6, 0.3, 5e-4);
    let direction = DVec2::from_angle(degrees.to_radians());
    let middle = points.iter().sum::<DVec2>() / points.len() as f64;
    let place = |p: &DVec2| {
        let (a, b) = (
            (*p - middle).dot(direction),
            (*p - middle).perp_dot(direction),
        );
        p.extend(0.5 * FLAT * (along * a * a + across * b * b))
    };
    let positions: Vec<DVec3> = points.iter().map(place).collect();
    let mesh = Mesh::new(faces, points.clone(), positions.clone()).unwrap();
    let area: f64 = mesh.rest_shape(1.0).face_area.iter().sum();
    let material = isotropic(sheet, 0.2).multiplied(1e-3, 1.0);
    let mut scene = scene(mesh, material, &[0]);
    scene.environment.gravity = DVec3::ZERO;
    scene.physics.even_bending = even;
    let still = vec![DVec3::ZERO; positions.len()];
    let simulator = Simulator::with_state(&scene, positions, still).unwrap();
    let plate = 0.5 * sheet.plate_stiffness() * (along * along + across * across) * FLAT * FLAT;
    simulator.potential_energy().unwrap() / (plate * area)
}

/// Largest error of the energy over that of a plate of Poisson's ratio -1/3, and which bends it has.
fn unevenness(mesh: &(Vec<DVec2>, Vec<[u32; 3]>), even: bool) -> (f64, Vec<f64>) {
    let one = [0.0, 22.5, 45.0, 67.5, 90.0, 112.5].map(|degrees| (degrees, [1.0, 0.0], 1.0));
    let two = [
        (0.0, [1.0, 1.0], 2.0 / 3.0),
        (0.0, [1.0, -1.0], 4.0 / 3.0),
        (45.0, [1.0, -1.0], 4.0 / 3.0),
    ];
    let error = |(degrees, bends, wanted): (f64, [f64; 2], f64)| {
        bending(mesh, degrees, bends, even) / wanted - 1.0
    };
    let errors: Vec<f64> = one.into_iter().chain(two).map(error).collect();
    (errors.iter().fold(0.0, |most, e| e.abs().max(most)), errors)
}

#[test]
fn irregular_hinges_bend_like_a_plate_of_poissons_ratio_minus_a_third() {
    for spacing in SPACINGS {
        for seed in 1..=3 {
            let mesh = irregular(0.3, 0.3, spacing, seed);
            let (plain, plain_errors) = unevenness(&mesh, false);
            let (even, even_errors) = unevenness(&mesh, true);
            println!("{spacing} {seed} plain {plain:.3} {plain_errors:.3?}");
            println!("{spacing} {seed} even {even:.3} {even_errors:.3?}");
            assert!(plain < 0.12 && even < 0.055, "{spacing} m: {plain} {even}");
        }
    }
    // On squares whose diagonals alternate they depend on the direction.
    let squares = regular(0.3, 0.3, 0.01);
    for (degrees, wanted) in [(0.0, 0.97), (45.0, 1.47)] {
        let found = bending(&squares, degrees, [1.0, 0.0], false);
        assert!((found - wanted).abs() < 0.03, "{degrees}: {found}");
    }
}

/// Tip of a cantilever of length 1 under its weight, whose bending length is `c`: how far out and
/// how far down, by the elastica.
fn elastica(c: f64) -> (f64, f64) {
    const STEPS: usize = 200;
    // From the free end: θ'' = -s cos θ/c³, θ' = 0 there, θ = 0 at the clamp.
    let shoot = |tip: f64| {
        let h = 1.0 / STEPS as f64;
        let rate = |s: f64, [angle, turn]: [f64; 2]| {
            let (sine, cosine) = angle.sin_cos();
            ([turn, -s * cosine / c.powi(3)], [cosine, sine])
        };
        let (mut y, mut place) = ([tip, 0.0], [0.0; 2]);
        for k in 0..STEPS {
            let s = k as f64 * h;
            let middle = |d: [f64; 2], f: f64| [y[0] + f * h * d[0], y[1] + f * h * d[1]];
            let (a, p) = rate(s, y);
            let (b, q) = rate(s + 0.5 * h, middle(a, 0.5));
            let (d, r) = rate(s + 0.5 * h, middle(b, 0.5));
            let (e, t) = rate(s + h, middle(d, 1.0));
            for i in 0..2 {
                y[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * d[i] + e[i]);
                place[i] += h / 6.0 * (p[i] + 2.0 * q[i] + 2.0 * r[i] + t[i]);
            }
        }
        (y[0], place)
    };
    let (mut low, mut high) = (0.0, FRAC_PI_2);
    for _ in 0..60 {
        let tip = 0.5 * (low + high);
        if shoot(tip).0 > 0.0 { high = tip } else { low = tip }
    }
    let [out, down] = shoot(low).1;
    (out, down)
}

/// Bending length over overhang of a cantilever whose chord falls by this angle `[rad]`.
fn bending_length(angle: f64) -> f64 {
    let (mut low, mut high) = (0.1_f64, 3.0_f64);
    for _ in 0..50 {
        let c = 0.5 * (low + high);
        let (out, down) = elastica(c);
        if (down / out).atan() > angle { low = c } else { high = c }
    }
    low
}

#[test]
fn the_elastica_has_the_bending_length_of_the_standard() {
    // ASTM D1388: at 41.5° the bending length is half of the overhang.
    let c = bending_length(41.5_f64.to_radians());
    assert!((c - 0.5).abs() < 0.01, "{c}");
}

/// Error of the bending length that an overhang of 100 mm, 200 mm wide, shows at about 41.5°, in
/// parts of it. So wide, it bends as a plate, whatever its Poisson's ratio. It is held along a line, from
/// which its mirror image hangs on the other side, or all of that side is `clamped`. `in_plane` is E h
/// `[N/m]`.
fn cantilever(half: (Vec<DVec2>, Vec<[u32; 3]>), is_clamped: bool, in_plane: f64) -> f64 {
    let overhang = 0.1;
    let (mesh, mut edge) = doubled(half, |p| {
        let fall = if is_clamped { (-p.y).max(0.0) } else { p.y.abs() };
        DVec3::new(p.y, -0.3 * fall, p.x)
    });
    if is_clamped {
        let beyond = (0_u32..).zip(mesh.material_coordinates());
        edge.extend(beyond.filter(|(_, p)| p.y > 1e-9).map(|(v, _)| v));
    }
    let tips: Vec<usize> = (0..mesh.positions().len())
        .filter(|v| mesh.material_coordinates()[*v].y < -overhang + 1e-9)
        .collect();
    let rest = hanging(mesh, &edge, 0.5 * overhang, in_plane);
    let tip = tips.iter().map(|v| rest[*v]).sum::<DVec3>() / tips.len() as f64;
    bending_length((-tip.y / tip.x.abs()).atan()) * overhang / (0.5 * overhang) - 1.0
}

/// E h of a sheet that hardly stretches, and of a fabric under the small loads of a drape `[N/m]`.
const IN_PLANE: [f64; 2] = [40_000.0, 1000.0];

/// Places of a sheet of this bending length `[m]` and this E h `[N/m]` that hangs from `held`.
fn hanging(mesh: Mesh, held: &[u32], bending_length: f64, in_plane: f64) -> Vec<DVec3> {
    let (sheet, density) = (elastic(in_plane / 2e-4, 0.3, 2e-4), 0.2);
    let wanted = bending_length.powi(3) * density * GRAVITY;
    let material = isotropic(sheet, density).multiplied(1.0, wanted / sheet.plate_stiffness());
    let mut scene = scene(mesh, material, held);
    scene.physics.even_bending = true;
    sag(&scene).unwrap().positions
}

/// Errors of [`SPACINGS`] on squares, and their means and largest over irregular meshes of six seeds.
fn errors(
    width: f64,
    height: f64,
    error: impl Fn((Vec<DVec2>, Vec<[u32; 3]>)) -> f64,
) -> [[f64; 3]; 3] {
    let irregular = SPACINGS.map(|h| {
        let each: [f64; 6] =
            std::array::from_fn(|k| error(irregular(width, height, h, k as u64 + 1)));
        let largest = each.iter().fold(0.0_f64, |most, e| most.max(e.abs()));
        (each.iter().sum::<f64>() / 6.0, largest)
    });
    let squares = SPACINGS.map(|h| error(regular(width, height, h)));
    [squares, irregular.map(|e| e.0), irregular.map(|e| e.1)]
}

#[test]
fn a_cantilever_has_its_bending_length() {
    for (is_clamped, in_plane) in [false, true]
        .into_iter()
        .flat_map(|is_clamped| IN_PLANE.map(|in_plane| (is_clamped, in_plane)))
    {
        let found = errors(0.2, 0.1, |mesh| cantilever(mesh, is_clamped, in_plane));
        println!("cantilever, clamped {is_clamped}, {in_plane} N/m: {found:.4?}");
        // A clamp's hinges bend on one side. As soft as others they are 3 to 7 % too limp, on all meshes.
        let [squares, mean, largest] = found;
        let is_fabric = in_plane == IN_PLANE[1];
        // Faces of constant strain lock a coarse sheet that hardly stretches and is held along a line.
        let bounds = if is_fabric { [0.02, 0.015, 0.015] } else { [0.04, 0.02, 0.02] };
        for (k, most) in bounds.into_iter().enumerate() {
            assert!(mean[k].abs() < most, "{found:.4?}");
            let on_squares = if is_fabric { 0.065 } else { 0.03 };
            assert!(squares[k].abs() < on_squares, "{found:.4?}");
            // Evened out for curvatures that the clamp forbids, its hinges were 4.3, 2.1, 1.6 % off.
            assert!(largest[k] < 1.5 * most, "{found:.4?}");
        }
    }
}

/// Half of a heart loop, of length 1, whose bending length is `c`: places along it from the bottom to
/// the clamp, by the elastica. Across the lower part acts h, along it its weight.
fn heart(c: f64) -> Vec<DVec2> {
    const STEPS: usize = 400;
    let shoot = |[turn, across]: [f64; 2]| {
        let step = 1.0 / STEPS as f64;
        let rate = |s: f64, [angle, turn, ..]: [f64; 4]| {
            let (sine, cosine) = angle.sin_cos();
            [turn, across * sine - s * cosine / c.powi(3), cosine, sine]
        };
        let (mut y, mut places) = ([0.0, turn, 0.0, 0.0], vec![DVec2::ZERO]);
        for k in 0..STEPS {
            let s = k as f64 * step;
            let moved = |d: [f64; 4], f: f64| std::array::from_fn(|i| y[i] + f * step * d[i]);
            let a = rate(s, y);
            let b = rate(s + 0.5 * step, moved(a, 0.5));
            let d = rate(s + 0.5 * step, moved(b, 0.5));
            let e = rate(s + step, moved(d, 1.0));
            y = std::array::from_fn(|i| y[i] + step / 6.0 * (a[i] + 2.0 * (b[i] + d[i]) + e[i]));
            places.push(DVec2::new(y[2], y[3]));
        }
        // At the clamp it points down, in the middle.
        (DVec2::new(y[0] - 3.0 * FRAC_PI_2, y[2]), places)
    };
    let mut at = [2.556, 8.81];
    for _ in 0..40 {
        let error = shoot(at).0;
        let slope = |k: usize| {
            let mut moved = at;
            moved[k] += 1e-6;
            (shoot(moved).0 - error) / 1e-6
        };
        let (a, b) = (slope(0), slope(1));
        let whole = a.perp_dot(b);
        let change = [error.perp_dot(b) / whole, a.perp_dot(error) / whole];
        let part = (1.0 / change[0].abs().max(change[1].abs())).min(1.0);
        at = std::array::from_fn(|k| at[k] - part * change[k]);
    }
    shoot(at).1
}

/// Error of the depth of a heart loop of 400 mm, 100 mm wide, of bending length 50 mm, in parts of it.
fn heart_loop(half: (Vec<DVec2>, Vec<[u32; 3]>), in_plane: f64) -> f64 {
    let (length, clamp) = (0.4, 1e-3);
    let shape = heart(0.05 / (0.5 * length));
    let place = |p: DVec2| {
        let s = p.y.abs() / (0.5 * length) * (shape.len() - 1) as f64;
        let k = (s as usize).min(shape.len() - 2);
        let at = shape[k].lerp(shape[k + 1], s - k as f64) * 0.5 * length;
        DVec3::new(at.x.copysign(p.y), at.y, p.x)
    };
    // Beyond each end a strip of 1 mm that the clamp holds too, and with it the direction.
    let (mut points, mut faces) = half;
    let mut end: Vec<u32> = (0..points.len() as u32)
        .filter(|v| points[*v as usize].y < -0.5 * length + 1e-9)
        .collect();
    end.sort_by(|a, b| points[*a as usize].x.total_cmp(&points[*b as usize].x));
    let first = points.len() as u32;
    for (k, pair) in (0..).zip(end.windows(2)) {
        let (a, b, c, d) = (first + k, first + k + 1, pair[1], pair[0]);
        faces.extend([[a, b, c], [a, c, d]]);
    }
    let beyond = |v: &u32| points[*v as usize] - DVec2::new(0.0, clamp);
    let beyond: Vec<DVec2> = end.iter().map(beyond).collect();
    points.extend(beyond);
    let (mesh, bottom) = doubled((points, faces), place);
    let held: Vec<u32> = (0..)
        .zip(mesh.material_coordinates())
        .filter(|(_, p)| p.y.abs() > 0.5 * length - 1e-9)
        .map(|(v, _)| v)
        .collect();
    let rest = hanging(mesh, &held, 0.05, in_plane);
    let top = shape[shape.len() - 1].y * 0.5 * length;
    let lowest = bottom.iter().map(|v| rest[*v as usize].y).sum::<f64>() / bottom.len() as f64;
    (top - lowest) / top - 1.0
}

#[test]
fn a_heart_loop_hangs_as_deep_as_the_elastica() {
    // Peirce: without weight 0.1337 of its length.
    let depth = 0.5 * heart(1e3)[400].y;
    assert!((depth - 0.1337).abs() < 5e-4, "{depth}");
    for in_plane in IN_PLANE {
        let found = errors(0.1, 0.2, |mesh| heart_loop(mesh, in_plane));
        println!("heart loop, {in_plane} N/m: {found:.4?}");
        let [squares, mean, largest] = found;
        for (k, most) in [0.03, 0.04, 0.02].into_iter().enumerate() {
            assert!(
                squares[k].abs() < 0.05 && mean[k].abs() < most,
                "{found:.4?}"
            );
            assert!(largest[k] < 0.075, "{found:.4?}");
        }
    }
}

/// Energy `[J]` of a strip of 50 by 200 mm between grips that draw it out by 5 %, its length at an angle
/// from u. Without gravity.
fn gripped(half: (Vec<DVec2>, Vec<[u32; 3]>), fabric: &Material, degrees: f64) -> f64 {
    let (mesh, _) = doubled(half, |p| DVec3::new(0.0, 1.05 * p.y, p.x));
    let ends = mesh.material_coordinates().iter().enumerate();
    let ends = ends.filter(|(_, p)| p.y.abs() > 0.1 - 1e-9);
    let held: Vec<u32> = ends.map(|(v, _)| v as u32).collect();
    let turn = DVec2::from_angle((degrees - 90.0).to_radians());
    let points = mesh
        .material_coordinates()
        .iter()
        .map(|p| turn.rotate(*p))
        .collect();
    let positions = mesh.positions().to_vec();
    let mesh = Mesh::new(&mesh.topology().face_indices(), points, positions).unwrap();
    let mut scene = scene(mesh, fabric.clone(), &held);
    scene.environment.gravity = DVec3::ZERO;
    let rest = sag(&scene).unwrap().positions;
    let still = vec![DVec3::ZERO; rest.len()];
    let simulator = Simulator::with_state(&scene, rest, still).unwrap();
    simulator.potential_energy().unwrap()
}

#[test]
fn a_strip_between_grips_has_the_energy_of_finer_meshes() {
    // Denim's threads are 4 and 19 times as stiff as its shear, an isotropic sheet 1 as stiff.
    let denim = material(DENIM);
    let mut loose = isotropic(elastic(5e6, 0.0, 2e-4), 0.2);
    loose.stretch = StretchTable([[500.0, 0.0, 500.0, 250.0]; 6]);
    for (fabric, degrees, most) in [
        (&denim, 0.0, 0.03),
        (&denim, 45.0, 0.06),
        (&denim, 90.0, 0.03),
        (&loose, 45.0, 0.015),
    ] {
        let fine = gripped(regular(0.05, 0.1, 0.0025), fabric, degrees);
        for (name, energies) in [
            (
                "regular",
                SPACINGS.map(|h| gripped(regular(0.05, 0.1, h), fabric, degrees)),
            ),
            (
                "irregular",
                SPACINGS.map(|h| gripped(irregular(0.05, 0.1, h, 1), fabric, degrees)),
            ),
        ] {
            let errors = energies.map(|energy| energy / fine - 1.0);
            println!("grips {} {degrees} {name} {errors:.4?}", fabric.name);
            // Faces of constant strain lock where they shear along threads that hardly stretch.
            assert!(errors[0].abs() < most, "{degrees}° {name}: {errors:.4?}");
        }
    }
}

/// Error of the sag of a limp strip of 0.6 m between two edges 0.5 m apart, in parts of it.
fn catenary(half: (Vec<DVec2>, Vec<[u32; 3]>)) -> f64 {
    let (length, apart) = (0.6, 0.5);
    // 2 a sinh(d/2a) = l, sag a (cosh(d/2a) - 1).
    let (mut low, mut high) = (0.05_f64, 10.0_f64);
    for _ in 0..80 {
        let a = 0.5 * (low + high);
        if 2.0 * a * (0.5 * apart / a).sinh() > length { low = a } else { high = a }
    }
    let expected = low * ((0.5 * apart / low).cosh() - 1.0);
    let sheet = elastic(1e8, 0.0, 2e-4);
    let slope = ((0.5 * length).powi(2) - (0.5 * apart).powi(2)).sqrt() / (0.5 * length);
    let place = |p: DVec2| DVec3::new(p.y * apart / length, slope * p.y.abs(), p.x);
    let (mesh, middle) = doubled(half, place);
    let ends = mesh.material_coordinates().iter().enumerate();
    let ends = ends
        .filter(|(_, p)| p.y.abs() > 0.5 * length - 1e-9)
        .map(|(v, _)| v as u32);
    let ends: Vec<u32> = ends.collect();
    let height = mesh.positions()[ends[0] as usize].y;
    let scene = scene(mesh, isotropic(sheet, 0.2).multiplied(1.0, 1e-3), &ends);
    let rest = sag(&scene).unwrap().positions;
    let lowest = middle.iter().map(|v| rest[*v as usize].y).sum::<f64>() / middle.len() as f64;
    (height - lowest) / expected - 1.0
}

#[test]
fn a_limp_strip_hangs_in_a_catenary() {
    for (name, errors) in [
        ("regular", SPACINGS.map(|h| catenary(regular(0.05, 0.3, h)))),
        (
            "irregular",
            SPACINGS.map(|h| catenary(irregular(0.05, 0.3, h, 1))),
        ),
    ] {
        assert!(errors[0].abs() < 0.03, "{name}: {errors:.4?}");
    }
}

#[test]
fn a_homogeneous_stretch_has_the_energy_of_the_law_on_any_mesh() {
    // Along warp, weft and bias: what a strip under tension does away from its grips.
    let fabric = material(DENIM);
    let law = selvedge_sim::laws::stretch_energy::StretchEnergy::new(&fabric.stretch);
    for mesh in [regular(0.1, 0.2, 0.015), irregular(0.1, 0.2, 0.015, 1)] {
        for degrees in [0.0_f64, 45.0, 90.0] {
            let direction = DVec2::from_angle(degrees.to_radians());
            let (along, across) = (1.05, 0.97);
            let place = |p: &DVec2| {
                let (a, b) = (p.dot(direction), p.perp_dot(direction));
                (direction * a * along - direction.perp() * b * across).extend(0.0)
            };
            let (points, faces) = &mesh;
            let positions: Vec<DVec3> = points.iter().map(place).collect();
            let cloth = Mesh::new(faces, points.clone(), positions.clone()).unwrap();
            let mut scene = scene(cloth, fabric.clone(), &[0]);
            scene.environment.gravity = DVec3::ZERO;
            let still = vec![DVec3::ZERO; positions.len()];
            let simulator = Simulator::with_state(&scene, positions, still).unwrap();
            let [a, b] = [along, across].map(|s: f64| 0.5 * (s * s - 1.0));
            let (c, s) = (direction.x, direction.y);
            let strain = selvedge_sim::laws::stretch::Strain {
                uu: a * c * c + b * s * s,
                vv: a * s * s + b * c * c,
                uv: (a - b) * s * c,
            };
            let expected = 0.02 * law.energy(strain);
            let found = simulator.potential_energy().unwrap();
            assert!(
                (found / expected - 1.0).abs() < 1e-9,
                "{degrees}: {found} {expected}"
            );
        }
    }
}

/// A drape of an isotropic sheet like blue cotton.
fn drape(vertices: usize, seed: u64) -> Drape {
    let spec = SheetSpec {
        shape: Shape::DrapeDisc,
        vertices,
        size: 0.3,
        width: None,
        seed,
    };
    let made = sheet(&spec).unwrap();
    let points = made.mesh.material_coordinates().to_vec();
    let flat = points
        .iter()
        .map(|p| DVec3::new(p.y - 0.15, 0.0, p.x - 0.15))
        .collect();
    let mesh = Mesh::new(&made.mesh.topology().face_indices(), points.clone(), flat).unwrap();
    let handles = Handles::new(made.label("clamped").unwrap(), vertices).unwrap();
    let sheet = elastic(1e6, 0.3, 1e-3);
    let bend = 1.7e-5 / sheet.plate_stiffness();
    let scene = Scene::of(
        "drape",
        mesh,
        handles,
        isotropic(sheet, 0.192).multiplied(1.0, bend),
    );
    let start = scene.mesh.positions().to_vec();
    let targets = HandleTargets::at_frame_end(scene.handles.select(&start)).unwrap();
    let still = vec![DVec3::ZERO; vertices];
    let mut simulator = Simulator::with_state(&scene, start, still).unwrap();
    for _ in 0..150 {
        simulator.step(&targets).unwrap();
    }
    let material: Vec<Vec2> = points.iter().map(|p| p.as_vec2()).collect();
    Drape::measure(
        scene.mesh.topology(),
        &material,
        &scene.handles,
        simulator.positions(),
    )
    .unwrap()
}

#[test]
fn a_sheet_like_blue_cotton_drapes_like_blue_cotton() {
    // Measured: 0.695 and 7.7 folds; 0.066 apart between captures.
    let drape = drape(870, 1);
    assert!((drape.coefficient - 0.695).abs() < 0.03, "{drape:?}");
    assert!((7..=9).contains(&drape.nodes), "{drape:?}");
}
