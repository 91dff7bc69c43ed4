//! The Abaqus deck, read by a small reader of its own: Abaqus itself is nowhere at hand, so what it would refuse is looked for.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;
use tempfile::TempDir;

/// Keywords that the deck may have, each with the parameters that Abaqus/Explicit knows there (of those that are written).
const KEYWORDS: [(&str, &[&str]); 27] = [
    ("HEADING", &[]),
    ("NODE", &["NSET"]),
    ("ELEMENT", &["TYPE", "ELSET"]),
    ("NSET", &["NSET"]),
    ("ELSET", &["ELSET"]),
    ("SURFACE", &["TYPE", "NAME"]),
    ("RIGID BODY", &["ELSET", "REF NODE"]),
    ("MATERIAL", &["NAME"]),
    ("DENSITY", &[]),
    ("ELASTIC", &[]),
    ("PLASTIC", &[]),
    ("SOLID SECTION", &["ELSET", "MATERIAL"]),
    ("SURFACE INTERACTION", &["NAME"]),
    ("SURFACE BEHAVIOR", &["PRESSURE-OVERCLOSURE"]),
    ("FRICTION", &[]),
    ("AMPLITUDE", &["NAME", "DEFINITION"]),
    ("STEP", &["NAME", "NLGEOM"]),
    ("DYNAMIC", &["EXPLICIT"]),
    ("BULK VISCOSITY", &[]),
    ("BOUNDARY", &["AMPLITUDE"]),
    ("CONTACT PAIR", &["INTERACTION", "CPSET", "MECHANICAL CONSTRAINT"]),
    ("CONTACT OUTPUT", &["CPSET"]),
    ("DAMPING", &["ALPHA"]),
    ("FIXED MASS SCALING", &["ELSET", "TYPE", "DT"]),
    ("OUTPUT", &["FIELD", "HISTORY", "NUMBER INTERVAL", "TIME INTERVAL"]),
    ("NODE OUTPUT", &["NSET"]),
    ("ELEMENT OUTPUT", &["ELSET"]),
];
const BARE: [&str; 2] = ["ENERGY OUTPUT", "END STEP"];

/// A keyword, its parameters, and the words of its data lines.
struct Block {
    name: String,
    parameters: BTreeMap<String, String>,
    data: Vec<Vec<String>>,
}

impl Block {
    fn get(&self, parameter: &str) -> &str {
        self.parameters.get(parameter).map_or("", String::as_str)
    }

    fn numbers(&self, line: usize) -> Vec<f64> {
        self.data[line].iter().filter(|w| !w.is_empty()).map(|w| w.parse().unwrap()).collect()
    }

    fn whole(&self) -> impl Iterator<Item = usize> + '_ {
        self.data.iter().flatten().filter(|w| !w.is_empty()).map(|w| w.parse().unwrap())
    }
}

fn read(text: &str) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let mut begun = String::new();
    for part in text.lines() {
        assert!(part.len() <= 80, "{part}");
        // A keyword that ends with a comma goes on in the next line.
        begun.push_str(part);
        if begun.starts_with('*') && !begun.starts_with("**") && begun.ends_with(',') {
            continue;
        }
        let line = std::mem::take(&mut begun);
        let line = line.as_str();
        assert!(line.is_ascii() && !line.is_empty(), "{line}");
        if line.starts_with("**") {
            continue;
        }
        let words = || line.trim_start_matches('*').split(',').map(|w| w.trim().to_owned());
        if line.starts_with('*') {
            let name = words().next().unwrap();
            let parameters = words().skip(1).map(|p| {
                let (key, value) = p.split_once('=').unwrap_or((&p, ""));
                (key.trim().to_owned(), value.trim().to_owned())
            });
            let parameters: BTreeMap<String, String> = parameters.collect();
            let known = KEYWORDS.iter().find(|k| k.0 == name).map(|k| k.1);
            assert!(known.is_some() || BARE.contains(&name.as_str()), "{line}");
            assert!(parameters.keys().all(|p| known.unwrap_or(&[]).contains(&p.as_str())), "{line}");
            blocks.push(Block { name, parameters, data: Vec::new() });
        } else {
            blocks.last_mut().expect("data before a keyword").data.push(words().collect());
        }
    }
    blocks
}

/// What a model defines.
#[derive(Default)]
struct Model {
    nodes: BTreeMap<usize, [f64; 3]>,
    elements: BTreeMap<usize, (String, Vec<usize>)>,
    node_sets: BTreeMap<String, BTreeSet<usize>>,
    element_sets: BTreeMap<String, BTreeSet<usize>>,
}

impl Model {
    fn of(blocks: &[Block]) -> Self {
        let mut m = Self::default();
        for b in blocks {
            match b.name.as_str() {
                "NODE" => {
                    let set = m.node_sets.entry(b.get("NSET").into()).or_default();
                    for i in 0..b.data.len() {
                        let [id, x, y, z] = b.numbers(i)[..] else { panic!("{:?}", b.data[i]) };
                        assert!(m.nodes.insert(id as usize, [x, y, z]).is_none(), "node {id} twice");
                        set.insert(id as usize);
                    }
                }
                "ELEMENT" => {
                    assert!(["C3D4", "R3D4"].contains(&b.get("TYPE")));
                    let set = m.element_sets.entry(b.get("ELSET").into()).or_default();
                    for i in 0..b.data.len() {
                        let all: Vec<usize> = b.numbers(i).iter().map(|n| *n as usize).collect();
                        assert!(
                            all.len() == 5 && all[1..].iter().all(|n| m.nodes.contains_key(n)),
                            "{all:?}"
                        );
                        let element = (b.get("TYPE").to_owned(), all[1..].to_vec());
                        assert!(m.elements.insert(all[0], element).is_none(), "element {} twice", all[0]);
                        set.insert(all[0]);
                    }
                }
                "NSET" => {
                    assert!(b.whole().all(|n| m.nodes.contains_key(&n)));
                    m.node_sets.insert(b.get("NSET").into(), b.whole().collect());
                }
                "ELSET" => {
                    assert!(b.whole().all(|n| m.elements.contains_key(&n)));
                    m.element_sets.insert(b.get("ELSET").into(), b.whole().collect());
                }
                _ => {}
            }
        }
        m
    }

    fn height(&self, set: &str) -> f64 {
        let z: Vec<f64> = self.node_sets[set].iter().map(|n| self.nodes[n][2]).collect();
        assert!(z.iter().all(|h| (h - z[0]).abs() < 1e-9), "{set}: {z:?}");
        z[0]
    }

    /// z of the normal of a facet, by the order of its nodes.
    fn facet_looks_up(&self, set: &str) -> bool {
        let (kind, nodes) = &self.elements[self.element_sets[set].first().unwrap()];
        assert_eq!(kind, "R3D4");
        let [a, b, c] = [0, 1, 2].map(|k| self.nodes[&nodes[k]]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0
    }
}

fn deck(args: &[&str]) -> String {
    let folder = TempDir::new().unwrap();
    let out = Command::new(env!("CARGO_BIN_EXE_grainrig"))
        .current_dir(folder.path())
        .args(["compress", "--sphere-diameter-mm", "0.8", "--size-mm", "0.15", "--size-at-contact-mm", "0.1"])
        .args(["--to-approach-mm", "0.002", "--out", "s"])
        .args(args)
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    std::fs::read_to_string(folder.path().join("s/abaqus.inp")).unwrap()
}

#[test]
fn the_abaqus_deck_is_a_whole_explicit_model() {
    for (args, plastic, friction) in [
        (&["--friction", "0"][..], None, None),
        (&["--material", "plastic", "--yield-mpa", "150", "--friction", "0.3"][..], Some(150.0), Some(0.3)),
    ] {
        let text = deck(args);
        let blocks = read(&text);
        let all = |name: &str| blocks.iter().filter(|b| b.name == name).collect::<Vec<_>>();
        let one = |name: &str| {
            assert_eq!(all(name).len(), 1, "{name}");
            all(name)[0]
        };
        let place = |name: &str| blocks.iter().position(|b| b.name == name).unwrap();
        let m = Model::of(&blocks);

        // The material, and the section that gives it to every tetrahedron.
        let section = one("SOLID SECTION");
        assert_eq!(section.get("MATERIAL"), one("MATERIAL").get("NAME"));
        let tets: BTreeSet<usize> = m.elements.iter().filter(|e| e.1.0 == "C3D4").map(|e| *e.0).collect();
        assert!(m.element_sets[section.get("ELSET")] == tets && tets.len() > 100);
        assert_eq!(one("DENSITY").numbers(0), [2.65e-9]);
        assert_eq!(one("ELASTIC").numbers(0), [100e3, 0.22]);
        let yields: Vec<f64> = all("PLASTIC").first().map_or(Vec::new(), |b| b.numbers(0));
        assert_eq!(yields, plastic.map_or(Vec::new(), |y| vec![y, 0.0]));
        // Positive volumes: the node order is Abaqus' own.
        for (_, nodes) in m.elements.values().filter(|e| e.0 == "C3D4") {
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| nalgebra::Vector3::from(m.nodes[&nodes[k]]));
            assert!((b - a).cross(&(c - a)).dot(&(d - a)) > 0.0);
        }

        // Rigid plates at the grain's ends, whose faces look at it.
        let grain = &m.node_sets["GRAIN_NODES"];
        let ends =
            grain.iter().map(|n| m.nodes[n][2]).fold([f64::MAX, f64::MIN], |e, z| [e[0].min(z), e[1].max(z)]);
        let (lower, upper) = (m.height("LOWER_PLATE_NODES"), m.height("UPPER_PLATE_NODES"));
        assert!((lower - ends[0]).abs() < 0.01 && (upper - ends[1]).abs() < 0.01 && lower < upper);
        assert!(m.facet_looks_up("LOWER_PLATE") && !m.facet_looks_up("UPPER_PLATE"));
        let bodies = all("RIGID BODY");
        assert_eq!(bodies.len(), 2);
        for (body, name) in bodies.iter().zip(["LOWER", "UPPER"]) {
            assert_eq!(body.get("ELSET"), format!("{name}_PLATE"));
            let reference: usize = body.get("REF NODE").parse().unwrap();
            assert!(m.node_sets[&format!("{name}_REFERENCE")].iter().eq([&reference]));
            assert!(!grain.contains(&reference));
        }

        // Contact between surfaces that there are, by a law that there is, hard.
        let surfaces = all("SURFACE");
        for s in &surfaces {
            assert!(s.data.iter().all(|line| {
                let [set, side] = &line[..] else { panic!("{line:?}") };
                let known = m.element_sets.contains_key(set) || set.parse().is_ok_and(|e| tets.contains(&e));
                known && ["S1", "S2", "S3", "S4", "SPOS"].contains(&side.as_str())
            }));
        }
        let pairs = all("CONTACT PAIR");
        assert_eq!(pairs.len(), 2);
        for pair in &pairs {
            assert_eq!(pair.get("INTERACTION"), one("SURFACE INTERACTION").get("NAME"));
            assert!(
                pair.data[0].len() == 2
                    && pair.data[0].iter().all(|n| surfaces.iter().any(|s| s.get("NAME") == n))
            );
        }
        assert_ne!(pairs[0].data[0], pairs[1].data[0]);
        assert_eq!(one("SURFACE BEHAVIOR").get("PRESSURE-OVERCLOSURE"), "HARD");
        assert_eq!(all("FRICTION").first().map(|b| b.numbers(0)[0]), friction);

        // One explicit step in which the plates come by the approach, smoothly, and move no other way.
        let (begin, end) = (place("STEP"), place("END STEP"));
        assert!(end + 1 == blocks.len() && one("STEP").get("NLGEOM") == "YES");
        for (i, b) in blocks.iter().enumerate() {
            let history = [
                "FIXED MASS SCALING",
                "DYNAMIC",
                "BULK VISCOSITY",
                "BOUNDARY",
                "CONTACT PAIR",
                "OUTPUT",
                "NODE OUTPUT",
            ];
            assert_eq!(
                (begin + 1..end).contains(&i),
                history.contains(&b.name.as_str()) || b.name.ends_with(" OUTPUT")
            );
        }
        let seconds = one("DYNAMIC").numbers(0)[0];
        assert!(one("DYNAMIC").parameters.contains_key("EXPLICIT") && seconds > 0.0);
        let smooth = one("AMPLITUDE");
        assert_eq!(smooth.get("DEFINITION"), "SMOOTH STEP");
        assert_eq!(smooth.numbers(0), [0.0, 0.0, seconds, 1.0]);
        let (mut driven, mut held) = (BTreeMap::new(), BTreeSet::new());
        for b in all("BOUNDARY") {
            for line in &b.data {
                assert!(m.node_sets.contains_key(&line[0]), "{line:?}");
                let [from, to] = [1, 2].map(|k| line[k].parse::<usize>().unwrap());
                if let Some(by) = line.get(3) {
                    assert!(from == 3 && to == 3 && b.get("AMPLITUDE") == smooth.get("NAME"));
                    driven.insert(line[0].clone(), by.parse::<f64>().unwrap());
                } else {
                    held.extend((from..=to).map(|k| (line[0].clone(), k)));
                }
            }
        }
        let (up, down) = (driven["LOWER_REFERENCE"], driven["UPPER_REFERENCE"]);
        assert!(driven.len() == 2 && up > 0.0 && (up + down).abs() < 1e-12);
        // 2 µm, and what the nodes stand out of the sphere.
        assert!((2.0 * up - 0.002 - (upper - lower - 0.8)).abs() < 1e-8, "{up}");
        let wanted = ["LOWER_REFERENCE", "UPPER_REFERENCE"]
            .iter()
            .flat_map(|n| [1, 2, 4, 5, 6].map(|k| ((*n).to_owned(), k)));
        assert_eq!(held, wanted.collect());
        // What is computed here is computed there: damping, mass scaling, and contact to be looked at.
        assert!(one("DAMPING").get("ALPHA").parse::<f64>().unwrap() > 1e4);
        let scaled = one("FIXED MASS SCALING");
        assert_eq!((scaled.get("ELSET"), scaled.get("TYPE")), ("GRAIN", "BELOW MIN"));
        assert!((1e-10..1e-7).contains(&scaled.get("DT").parse::<f64>().unwrap()));
        let contact = all("CONTACT OUTPUT");
        assert_eq!(contact[0].data[0], ["CSTRESS", "CFORCE"]);
        for (output, pair) in contact[1..].iter().zip(&pairs) {
            assert_eq!(output.get("CPSET"), pair.get("CPSET"));
            assert_eq!(output.data[0], ["CFN", "CAREA"]);
        }
        assert_eq!(contact.len(), 3);
        let said = text.lines().filter_map(|l| l.strip_prefix("** ")).collect::<Vec<_>>();
        assert!(
            said.iter().any(|l| l.contains("double=both")) && said.iter().any(|l| l.contains("mm, half by")),
            "{said:?}"
        );
        for b in all("NODE OUTPUT").iter().filter(|b| b.parameters.contains_key("NSET")) {
            assert!(m.node_sets.contains_key(b.get("NSET")));
        }
    }
}
