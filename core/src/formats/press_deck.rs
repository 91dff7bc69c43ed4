//! A grain between two rigid plates as a whole deck: for Abaqus/Explicit, and for `CalculiX` as a static analysis that runs.

use super::{ExportError, inp};
use crate::contact::{Material, Program};
use crate::mesh::TetMesh;
use std::io::Write;

/// Part of the grain's height, at either end, whose surface can meet a plate.
const BAND: f64 = 0.25;
/// Side of a plate over the grain's height.
const SIDE: f64 = 3.0;
/// Contact stiffness of the `CalculiX` deck, MPa/mm over E/H: an overclosure of 0.1 µm and less under 20 GPa.
const STIFFNESS: f64 = 2000.0;
/// Springs that hold what nothing else holds before the plates do, N/mm over E·H.
const SPRING: f64 = 1e-6;
/// The same with friction: a grain on one or two points swings between sticking and slipping, and no iteration ends. Three of
/// 1e-4 E·H take a few thousandths of the force.
const SPRING_STUCK: f64 = 1e-4;
/// Slope of friction against the slip, over the contact's stiffness.
const STICK: f64 = 0.01;
/// What counts as a force when residuals are judged, N over E·H²: a hundredth of what decks are usually pressed to. Before the
/// plates carry anything `CalculiX` would compare residuals with nothing.
const FLUX: f64 = 1e-6;

/// The contents of a deck.
#[derive(Debug, Clone, Copy)]
pub struct Deck<'a> {
    /// The grain, mm.
    pub mesh: &'a TetMesh,
    /// Its material.
    pub material: &'a Material,
    /// Heights of the lower and the upper plate's face, mm.
    pub plates_mm: [f64; 2],
    /// Coulomb's friction.
    pub friction: f64,
    /// The approach of the plates at the end, mm; each moves by half.
    pub approach_mm: f64,
    /// How long an explicit step takes, s.
    pub seconds: f64,
    /// Mass-proportional damping, 1/s.
    pub damping_per_s: f64,
    /// The stable step, s, up to which elements of a smaller one are given mass; none for no mass scaling.
    pub scaled_to_s: Option<f64>,
    /// Equal parts of the approach at which reactions are written.
    pub steps: usize,
    /// Where the mesh is from.
    pub source: &'a str,
}

impl Deck<'_> {
    fn height(&self) -> f64 {
        self.plates_mm[1] - self.plates_mm[0]
    }

    fn provenance(&self, run: &str) -> Vec<String> {
        vec![
            format!("{} between rigid plates", self.source),
            format!("approach {:.9} mm, half by each plate", self.approach_mm),
            run.into(),
        ]
    }

    /// For Abaqus with the damping of the explicit computation.
    fn materials(&self, program: Program, out: &mut impl Write) -> Result<(), ExportError> {
        let m = self.material;
        let answers = m.deck(program).ok_or_else(|| ExportError::Unfit {
            format: "a deck",
            what: format!("{program:?} has no material law like {}", m.law().name),
        })?;
        writeln!(out, "*MATERIAL, NAME=GRAIN_MATERIAL\n*DENSITY\n{:e}", m.density_t_mm3)?;
        write!(out, "{answers}")?;
        if program == Program::Abaqus && self.damping_per_s > 0.0 {
            writeln!(out, "*DAMPING, ALPHA={:.6e}", self.damping_per_s)?;
        }
        writeln!(out, "*SOLID SECTION, ELSET=GRAIN, MATERIAL=GRAIN_MATERIAL")?;
        Ok(())
    }

    /// The corners of a plate, seen from above counter-clockwise from (−, −), at a height.
    fn corners(&self, z: f64) -> [[f64; 3]; 4] {
        let n = self.mesh.nodes.len().max(1) as f64;
        let sum = self.mesh.nodes.iter().fold([0.0; 2], |s, p| [s[0] + p.x / n, s[1] + p.y / n]);
        let half = 0.5 * SIDE * self.height();
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| [sum[0] + half * x, sum[1] + half * y, z])
    }

    /// The deck for Abaqus/Explicit: rigid plates of one facet, hard contact, smooth start.
    ///
    /// # Errors
    /// [`ExportError`]: as for the mesh alone.
    pub fn abaqus(&self, mut out: impl Write) -> Result<(), ExportError> {
        // Hundreds of thousands of steps, each of which moves a node by some 1e-9 of the grain: single precision loses that.
        let run = "run in double precision: abaqus job=NAME input=abaqus.inp double=both";
        inp::write(self.mesh, &self.provenance(run), BAND * self.height(), &mut out)?;
        let first = self.mesh.nodes.len() + 1;
        let element = self.mesh.tets.len() + 1;
        for (i, (name, z)) in
            [("LOWER", self.plates_mm[0]), ("UPPER", self.plates_mm[1])].into_iter().enumerate()
        {
            let at = first + 5 * i;
            writeln!(out, "*NODE, NSET={name}_PLATE_NODES")?;
            for (k, p) in self.corners(z).iter().enumerate() {
                writeln!(out, "{}, {:.9e}, {:.9e}, {:.9e}", at + k, p[0], p[1], p[2])?;
            }
            let middle = self.corners(z);
            let (x, y) = (0.5 * (middle[0][0] + middle[2][0]), 0.5 * (middle[0][1] + middle[2][1]));
            writeln!(out, "*NODE, NSET={name}_REFERENCE\n{}, {x:.9e}, {y:.9e}, {z:.9e}", at + 4)?;
            // The facet's normal points to the grain.
            let order = if i == 0 { [0, 1, 2, 3] } else { [3, 2, 1, 0] };
            let [a, b, c, d] = order.map(|k| at + k);
            writeln!(out, "*ELEMENT, TYPE=R3D4, ELSET={name}_PLATE\n{}, {a}, {b}, {c}, {d}", element + i)?;
            writeln!(out, "*RIGID BODY, ELSET={name}_PLATE, REF NODE={}", at + 4)?;
            writeln!(out, "*SURFACE, NAME={name}_FACE\n{name}_PLATE, SPOS")?;
        }
        self.materials(Program::Abaqus, &mut out)?;
        writeln!(out, "*SURFACE INTERACTION, NAME=HARD\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD")?;
        if self.friction > 0.0 {
            writeln!(out, "*FRICTION\n{}", self.friction)?;
        }
        writeln!(out, "*AMPLITUDE, NAME=SMOOTH, DEFINITION=SMOOTH STEP\n0., 0., {:.9e}, 1.", self.seconds)?;
        writeln!(out, "*STEP, NAME=COMPRESS, NLGEOM=YES\n*DYNAMIC, EXPLICIT\n, {:.9e}", self.seconds)?;
        writeln!(out, "*BULK VISCOSITY\n0.06, 1.2")?;
        if let Some(step_s) = self.scaled_to_s {
            // The elements that are given mass here are given it there, up to how either program reckons an element's step.
            writeln!(out, "*FIXED MASS SCALING, ELSET=GRAIN, TYPE=BELOW MIN, DT={step_s:.6e}")?;
        }
        let by = 0.5 * self.approach_mm;
        writeln!(out, "*BOUNDARY, AMPLITUDE=SMOOTH")?;
        for (name, by) in [("LOWER", by), ("UPPER", -by)] {
            writeln!(out, "{name}_REFERENCE, 3, 3, {by:.9e}")?;
        }
        writeln!(out, "*BOUNDARY")?;
        for name in ["LOWER", "UPPER"] {
            writeln!(out, "{name}_REFERENCE, 1, 2\n{name}_REFERENCE, 4, 6")?;
        }
        for (name, grain) in [("LOWER", "BOTTOM_SURFACE"), ("UPPER", "TOP_SURFACE")] {
            // A keyword that ends with a comma goes on in the next line.
            writeln!(
                out,
                "*CONTACT PAIR, INTERACTION=HARD, CPSET={name}_CONTACT,\nMECHANICAL CONSTRAINT=KINEMATIC\n{grain}, {name}_FACE"
            )?;
        }
        writeln!(out, "*OUTPUT, FIELD, NUMBER INTERVAL={}", self.steps)?;
        writeln!(out, "*NODE OUTPUT\nU\n*ELEMENT OUTPUT, ELSET=GRAIN\nS, PEEQ")?;
        writeln!(out, "*CONTACT OUTPUT\nCSTRESS, CFORCE")?;
        writeln!(out, "*OUTPUT, HISTORY, TIME INTERVAL={:.6e}", self.seconds / 200.0)?;
        for name in ["LOWER", "UPPER"] {
            writeln!(out, "*NODE OUTPUT, NSET={name}_REFERENCE\nU3, RF3")?;
            // The resultant of the pressure, and the area that carries it.
            writeln!(out, "*CONTACT OUTPUT, CPSET={name}_CONTACT\nCFN, CAREA")?;
        }
        writeln!(out, "*ENERGY OUTPUT\nALLKE, ALLIE, ALLWK, ALLPD, ETOTAL\n*END STEP")?;
        Ok(out.flush()?)
    }

    /// The deck for `CalculiX`: a static analysis with plates of one held brick each. Strains are small ones, because with
    /// `NLGEOM` `CalculiX` takes the law of St. Venant and Kirchhoff, which softens under a contact. Without friction nodes meet the
    /// plates, as they do in [`crate::contact`]. With friction that does not converge; then facets meet them, at the points inside
    /// at which they are integrated, so that a round contact begins later by about what a facet sags: its size squared over 8 R.
    /// Reactions of `LOWER_PLATE_NODES` and
    /// `UPPER_PLATE_NODES` come out in the `.dat` file.
    ///
    /// # Errors
    /// [`ExportError`]: as for the mesh alone.
    pub fn calculix(&self, mut out: impl Write) -> Result<(), ExportError> {
        let height = self.height();
        inp::write(self.mesh, &self.provenance("run: ccx -i calculix"), BAND * height, &mut out)?;
        let first = self.mesh.nodes.len() + 1;
        let element = self.mesh.tets.len() + 1;
        let thick = 0.5 * height;
        for (i, (name, z)) in
            [("LOWER", self.plates_mm[0]), ("UPPER", self.plates_mm[1])].into_iter().enumerate()
        {
            let at = first + 8 * i;
            let (bottom, top) = if i == 0 { (z - thick, z) } else { (z, z + thick) };
            writeln!(out, "*NODE, NSET={name}_PLATE_NODES")?;
            for (k, p) in self.corners(bottom).iter().chain(&self.corners(top)).enumerate() {
                writeln!(out, "{}, {:.9e}, {:.9e}, {:.9e}", at + k, p[0], p[1], p[2])?;
            }
            let list: Vec<String> = (0..8).map(|k| (at + k).to_string()).collect();
            writeln!(out, "*ELEMENT, TYPE=C3D8, ELSET={name}_PLATE\n{}, {}", element + i, list.join(", "))?;
            writeln!(
                out,
                "*SURFACE, NAME={name}_FACE, TYPE=ELEMENT\n{name}_PLATE, S{}",
                if i == 0 { 2 } else { 1 }
            )?;
        }
        self.springs(&mut out, element + 2)?;
        self.materials(Program::Calculix, &mut out)?;
        writeln!(out, "*MATERIAL, NAME=PLATE_MATERIAL\n*ELASTIC\n{}, 0.", self.material.young_mpa)?;
        for name in ["LOWER", "UPPER"] {
            writeln!(out, "*SOLID SECTION, ELSET={name}_PLATE, MATERIAL=PLATE_MATERIAL")?;
        }
        writeln!(out, "*SURFACE INTERACTION, NAME=HARD\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR")?;
        writeln!(out, "{:.6e}", STIFFNESS * self.material.young_mpa / height)?;
        if self.friction > 0.0 {
            let stick = STICK * STIFFNESS * self.material.young_mpa / height;
            writeln!(out, "*FRICTION\n{}, {stick:.6e}", self.friction)?;
        }
        for (grain, plate) in [("BOTTOM_SURFACE", "LOWER_FACE"), ("TOP_SURFACE", "UPPER_FACE")] {
            let kind = if self.friction > 0.0 { "SURFACE TO SURFACE" } else { "NODE TO SURFACE" };
            writeln!(out, "*CONTACT PAIR, INTERACTION=HARD, TYPE={kind}\n{grain}, {plate}")?;
        }
        let part = 1.0 / self.steps.max(1) as f64;
        writeln!(out, "*STEP, INC=1000\n*STATIC\n{part}, 1., 1e-6, {part}")?;
        if self.friction > 0.0 {
            // Residuals are held against a force of the size that matters, corrections against a whole increment: while the
            // grain hangs on a point it may shift by more than a hundredth of one without any force.
            let flux = FLUX * self.material.young_mpa * height * height;
            writeln!(out, "*CONTROLS, PARAMETERS=FIELD\n0.005, 1., 0.01, {flux:.3e}, 0.02, 1e-5, 1., 1e-8")?;
        }
        writeln!(out, "*BOUNDARY")?;
        for (name, by) in [("LOWER", 0.5 * self.approach_mm), ("UPPER", -0.5 * self.approach_mm)] {
            writeln!(out, "{name}_PLATE_NODES, 1, 2\n{name}_PLATE_NODES, 3, 3, {by:.9e}")?;
        }
        for name in ["LOWER", "UPPER"] {
            writeln!(out, "*NODE PRINT, NSET={name}_PLATE_NODES, TOTALS=ONLY\nRF")?;
        }
        writeln!(out, "*END STEP")?;
        Ok(out.flush()?)
    }

    /// Soft springs in every direction at three nodes far apart.
    fn springs(&self, out: &mut impl Write, element: usize) -> std::io::Result<()> {
        let far = |of: fn(&crate::geometry::Point) -> f64| {
            let nodes = self.mesh.nodes.iter().enumerate();
            nodes.max_by(|a, b| of(a.1).total_cmp(&of(b.1))).map_or(0, |(i, _)| i)
        };
        let mut nodes = vec![far(|p| p.x), far(|p| -p.x), far(|p| p.y)];
        nodes.dedup();
        let stiffness = if self.friction > 0.0 { SPRING_STUCK } else { SPRING };
        let mut next = element;
        for axis in 1..=3 {
            writeln!(out, "*ELEMENT, TYPE=SPRING1, ELSET=SPRING_{axis}")?;
            for n in &nodes {
                writeln!(out, "{next}, {}", n + 1)?;
                next += 1;
            }
            writeln!(
                out,
                "*SPRING, ELSET=SPRING_{axis}\n{axis}\n{:.6e}",
                stiffness * self.material.young_mpa * self.height()
            )?;
        }
        Ok(())
    }
}
