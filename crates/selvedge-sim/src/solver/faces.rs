//! The faces of a cloth, evaluated in groups of neighbours in the lists.
//!
//! A group of one fabric by [`ElasticLaw::Energy`](selvedge_cloth::ElasticLaw::Energy) is computed
//! side by side; others face by face. The result is the same, whatever the width of the machine's
//! vectors.

use glam::{DVec3, Mat3A};
use pulp::{Arch, Simd, WithSimd};
use selvedge_cloth::Environment;

use crate::laws::external::{Drag, air_response};
use crate::laws::number::{
    GROUP, Lanes, LanesVector, Number, Row, Vector, gather, of_lane, of_lanes, scatter, set_lane,
};
use crate::laws::stretch::{StretchElement, StretchLaw, StretchResponse};
use crate::laws::stretch_energy::StretchEnergy;
use crate::solver::elements::Linearisation;
use crate::solver::groups::Groups;
use crate::threads::Threads;

/// Faces that are evaluated together. Those beyond the last face have no area.
pub(crate) struct Group {
    corners: [[u32; 3]; GROUP],
    element: [Row; 5],
    /// Number of each one's material.
    materials: [u32; GROUP],
}

/// Response of a face at the last evaluation: of its material and of the air.
#[derive(Clone, Copy)]
pub(crate) struct FaceResponse<N: Number = f64> {
    pub(crate) stretch: StretchResponse<N>,
    pub(crate) drag: Drag<N>,
    /// Factor from its Jacobian to a mass `[s²]`: dt (dt + c), c its damping.
    pub(crate) jacobian: N,
}

const NUMBERS: usize = 24;

/// The faces of a cloth, evaluated.
pub(crate) type Faces = Groups<Group, 3, NUMBERS>;

/// Blocks of a face's corners in its part of the matrix: 00, 10, 11, 20, 21, 22.
#[derive(Clone, Copy)]
pub(crate) struct FaceBlocks(pub(crate) [Mat3A; 6]);

impl FaceBlocks {
    /// Block (`row`, `column`).
    #[inline]
    pub(crate) fn of(&self, row: usize, column: usize) -> Mat3A {
        let of = |row: usize, column: usize| self.0[row * (row + 1) / 2 + column];
        if row >= column { of(row, column) } else { of(column, row).transpose() }
    }
}

/// What the faces of an evaluation share.
#[derive(Clone, Copy)]
pub(crate) struct Setting<'a> {
    pub(crate) at: Linearisation<'a>,
    pub(crate) environment: &'a Environment,
    /// Stiffness-proportional damping of each material `[s]`.
    pub(crate) damping: &'a [f64],
}

impl<N: Number> FaceResponse<N> {
    #[inline(always)]
    fn of(element: StretchElement<N>, numbers: [N; NUMBERS]) -> Self {
        let (mut stretch, mut drag) = ([numbers[0]; 18], [numbers[0]; 5]);
        stretch.copy_from_slice(&numbers[..18]);
        drag.copy_from_slice(&numbers[18..23]);
        Self {
            stretch: StretchResponse::of(element, stretch),
            drag: Drag::of(drag),
            jacobian: numbers[23],
        }
    }

    #[inline(always)]
    fn numbers(&self) -> [N; NUMBERS] {
        let mut numbers = [self.jacobian; NUMBERS];
        numbers[..18].copy_from_slice(&self.stretch.numbers());
        numbers[18..23].copy_from_slice(&self.drag.numbers());
        numbers
    }

    /// The response of a face at these places, and the impulses on its corners `[N s]`.
    #[inline(always)]
    fn evaluate<L: StretchLaw<N>>(
        element: StretchElement<N>,
        law: &L,
        damping: f64,
        setting: &Setting<'_>,
        [places, rates, air_velocities]: [[N::Vector; 3]; 3],
    ) -> (Self, [N::Vector; 3]) {
        let Setting {
            at, environment, ..
        } = setting;
        let area = element.area;
        let stretch = element.respond(law, at.stiffening, places);
        let (air, drag) =
            air_response(environment, at.air_resistance, area, places, air_velocities);
        let resisting = stretch.negative_jacobian_times(rates);
        let third = air * area.same(at.dt / 3.0);
        let (rate, dt) = (area.same(at.rate(damping)), area.same(at.dt));
        let force = stretch.force();
        let mut pushes = [third; 3];
        for (push, (force, resisting)) in pushes.iter_mut().zip(force.into_iter().zip(resisting)) {
            *push = force * dt - resisting * rate + third;
        }
        let jacobian = area.same(at.jacobian(damping));
        let response = Self {
            stretch,
            drag,
            jacobian,
        };
        (response, pushes)
    }

    /// Columns of the blocks 00, 10, 11, 20, 21, 22 of its corners in the matrix, times `scale`, with
    /// `ninth` of the drag: two corners' blocks give the third's, whose motion is theirs.
    #[inline(always)]
    fn blocks(&self, scale: f64, ninth: f64) -> [[[N; 3]; 3]; 6] {
        let scale = self.jacobian * scale;
        // Entry (i, j) of a block is `[j][i]`.
        let one = components(self.stretch.negative_jacobian(1, 1), scale);
        let two = components(self.stretch.negative_jacobian(2, 2), scale);
        let both = components(self.stretch.negative_jacobian(2, 1), scale);
        let [through, across] = self.drag.resistance;
        let (through, across) = (through * ninth, across * ninth);
        let normal = self.drag.normal.components();
        let mut blocks = [[[scale; 3]; 3]; 6];
        for j in 0..3 {
            for i in 0..3 {
                let along = normal[i] * (through - across) * normal[j];
                let air = if i == j { along + across } else { along };
                let (left, right) = (one[j][i] + both[i][j], both[j][i] + two[j][i]);
                blocks[0][j][i] = left + right + air;
                blocks[1][j][i] = air - left;
                blocks[2][j][i] = one[j][i] + air;
                blocks[3][j][i] = air - right;
                blocks[4][j][i] = both[j][i] + air;
                blocks[5][j][i] = two[j][i] + air;
            }
        }
        blocks
    }

    /// (dt (dt + c) (-J) + dt D_air) times one vector per corner.
    #[inline(always)]
    fn times(&self, dt: f64, vectors: [N::Vector; 3]) -> [N::Vector; 3] {
        let [a, b, c] = vectors;
        let resisting = self.stretch.negative_jacobian_times(vectors);
        let air = self.drag.resist(a + b + c) * self.jacobian.same(dt / 9.0);
        let [a, b, c] = resisting;
        [
            a * self.jacobian + air,
            b * self.jacobian + air,
            c * self.jacobian + air,
        ]
    }
}

impl Faces {
    /// Faces of these corners and elements, of these materials.
    pub(crate) fn new(faces: &[([u32; 3], StretchElement)], materials: &[usize]) -> Self {
        let groups = faces.chunks(GROUP).zip(materials.chunks(GROUP));
        let groups: Vec<Group> = groups
            .map(|(faces, materials)| {
                let mut group = Group {
                    corners: [faces[0].0; GROUP],
                    element: [[0.0; GROUP]; 5],
                    materials: [materials[0] as u32; GROUP],
                };
                for (lane, ((corners, element), material)) in
                    faces.iter().zip(materials).enumerate()
                {
                    group.corners[lane] = *corners;
                    set_lane(&mut group.element, lane, element.numbers());
                    group.materials[lane] = *material as u32;
                }
                group
            })
            .collect();
        Self::of(faces.len(), groups)
    }

    pub(crate) fn corners(&self) -> impl Iterator<Item = [u32; 3]> {
        let corners = self.groups.iter().flat_map(|group| group.corners);
        corners.take(self.count())
    }

    pub(crate) fn elements(&self) -> impl Iterator<Item = (StretchElement, u32)> {
        let lanes = self.groups.iter().flat_map(|group| {
            let element = |lane| StretchElement::of(of_lane(&group.element, lane));
            (0..GROUP).map(move |lane| (element(lane), group.materials[lane]))
        });
        lanes.take(self.count())
    }

    pub(crate) fn response(&self, face: usize) -> FaceResponse {
        let (group, lane) = (face / GROUP, face % GROUP);
        let element = StretchElement::of(of_lane(&self.groups[group].element, lane));
        FaceResponse::of(element, of_lane(&self.responses[group], lane))
    }

    /// Evaluates the faces, side by side where a group has one material.
    pub(crate) fn evaluate_energy(
        &mut self,
        threads: Threads,
        laws: &[StretchEnergy],
        setting: Setting<'_>,
    ) {
        self.each(threads, |group, response, impulses| {
            let [first, rest @ ..] = group.materials;
            if rest == [first; GROUP - 1] {
                Arch::new().dispatch(Evaluation {
                    group,
                    law: &laws[first as usize],
                    setting,
                    response,
                    impulses,
                });
            } else {
                group.evaluate(laws, setting, response, impulses);
            }
        });
    }

    /// Evaluates the faces one by one.
    pub(crate) fn evaluate<L: StretchLaw + Sync>(
        &mut self,
        threads: Threads,
        laws: &[L],
        setting: Setting<'_>,
    ) {
        self.each(threads, |group, response, impulses| {
            group.evaluate(laws, setting, response, impulses);
        });
    }

    /// Sets the impulses to (dt (dt + c) (-J) + dt D_air) `vector`, `[vertices]`.
    pub(crate) fn multiply(&mut self, threads: Threads, dt: f64, vector: &[DVec3]) {
        self.each(threads, |group, response, impulses| {
            Arch::new().dispatch(Product {
                group,
                dt,
                vector,
                response,
                impulses,
            });
        });
    }

    /// Blocks of the faces of a group in the matrix, as [`FaceResponse::blocks`] has them, in f32.
    pub(crate) fn blocks(
        &self,
        group: usize,
        scale: f64,
        ninth: f64,
        blocks: &mut [FaceBlocks; GROUP],
    ) {
        Arch::new().dispatch(Blocks {
            element: &self.groups[group].element,
            response: &self.responses[group],
            scale,
            ninth,
            blocks,
        });
    }
}

impl Group {
    fn evaluate<L: StretchLaw>(
        &self,
        laws: &[L],
        setting: Setting<'_>,
        response: &mut [Row; NUMBERS],
        impulses: &mut [[DVec3; 3]; GROUP],
    ) {
        let at = setting.at;
        for (lane, (corners, impulses)) in self.corners.iter().zip(impulses).enumerate() {
            let material = self.materials[lane] as usize;
            let select = |from: &[DVec3]| corners.map(|corner| from[corner as usize]);
            let (answer, pushes) = FaceResponse::evaluate(
                StretchElement::of(of_lane(&self.element, lane)),
                &laws[material],
                setting.damping[material],
                &setting,
                [at.positions, at.rates, at.air_velocities].map(select),
            );
            set_lane(response, lane, answer.numbers());
            *impulses = pushes;
        }
    }
}

/// The evaluation of a group of one material.
struct Evaluation<'a> {
    group: &'a Group,
    law: &'a StretchEnergy,
    setting: Setting<'a>,
    response: &'a mut [Row; NUMBERS],
    impulses: &'a mut [[DVec3; 3]; GROUP],
}

impl WithSimd for Evaluation<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let at = self.setting.at;
        let damping = self.setting.damping[self.group.materials[0] as usize];
        let corners = &self.group.corners;
        let places = gather(at.positions, corners);
        let rates = gather(at.rates, corners);
        let air_velocities = if std::ptr::eq(at.rates, at.air_velocities) {
            rates
        } else {
            gather(at.air_velocities, corners)
        };
        let mut pushes = [[[0.0; GROUP]; 3]; 3];
        for part in 0..Lanes::<S>::PARTS {
            let element = StretchElement::of(Lanes::load_all(simd, &self.group.element, part));
            let vectors = [
                Lanes::vectors(simd, &places, part),
                Lanes::vectors(simd, &rates, part),
                Lanes::vectors(simd, &air_velocities, part),
            ];
            let (answer, push) =
                FaceResponse::evaluate(element, self.law, damping, &self.setting, vectors);
            Lanes::store_all(answer.numbers(), self.response, part);
            LanesVector::store_all(push, &mut pushes, part);
        }
        scatter(&pushes, self.impulses);
    }
}

struct Product<'a> {
    group: &'a Group,
    dt: f64,
    vector: &'a [DVec3],
    response: &'a [Row; NUMBERS],
    impulses: &'a mut [[DVec3; 3]; GROUP],
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let vectors = gather(self.vector, &self.group.corners);
        let mut pushes = [[[0.0; GROUP]; 3]; 3];
        for part in 0..Lanes::<S>::PARTS {
            let element = StretchElement::of(Lanes::load_all(simd, &self.group.element, part));
            let response = FaceResponse::of(element, Lanes::load_all(simd, self.response, part));
            let push = response.times(self.dt, Lanes::vectors(simd, &vectors, part));
            LanesVector::store_all(push, &mut pushes, part);
        }
        scatter(&pushes, self.impulses);
    }
}

struct Blocks<'a> {
    element: &'a [Row; 5],
    response: &'a [Row; NUMBERS],
    scale: f64,
    ninth: f64,
    blocks: &'a mut [FaceBlocks; GROUP],
}

impl WithSimd for Blocks<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let mut rows = [[[[0.0; GROUP]; 3]; 3]; 6];
        for part in 0..Lanes::<S>::PARTS {
            let element = StretchElement::of(Lanes::load_all(simd, self.element, part));
            let response = FaceResponse::of(element, Lanes::load_all(simd, self.response, part));
            let blocks = response.blocks(self.scale, self.ninth);
            for (block, rows) in blocks.into_iter().zip(&mut rows) {
                for (column, rows) in block.into_iter().zip(rows) {
                    Lanes::store_all(column, rows, part);
                }
            }
        }
        for (number, [x, y, z]) in rows.iter().enumerate() {
            for (lane, blocks) in self.blocks.iter_mut().enumerate() {
                blocks.0[number] =
                    Mat3A::from_cols(of_lanes(x, lane), of_lanes(y, lane), of_lanes(z, lane));
            }
        }
    }
}

/// The components of columns, times `scale`.
#[inline(always)]
fn components<N: Number>([x, y, z]: [N::Vector; 3], scale: N) -> [[N; 3]; 3] {
    [
        (x * scale).components(),
        (y * scale).components(),
        (z * scale).components(),
    ]
}
