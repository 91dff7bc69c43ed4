//! Rays against triangles: a binary tree of boxes, split where the surface-area heuristic is least (Wald 2007, binned).

use nalgebra::Vector3;

type V = Vector3<f64>;

/// Boxes' centres are counted in so many bins along each axis.
const BINS: usize = 12;
/// Triangles that a leaf may hold.
const LEAF: usize = 4;

/// Where a ray meets a surface.
#[derive(Debug, Clone, Copy)]
pub struct Hit {
    /// Distance along the ray, in lengths of its direction.
    pub t: f64,
    /// The triangle, as it was given.
    pub triangle: usize,
    /// Weights of its second and third corner.
    pub weights: [f64; 2],
}

#[derive(Debug, Clone, Copy)]
struct Node {
    low: [f32; 3],
    high: [f32; 3],
    /// The first triangle of a leaf, or the second child; the first child follows its parent.
    next: u32,
    /// Triangles of a leaf; 0 for an inner node.
    count: u32,
}

/// A corner, two edges, and the triangle's number.
#[derive(Debug, Clone, Copy)]
struct Triangle {
    corner: [f32; 3],
    edges: [[f32; 3]; 2],
    number: u32,
}

/// A tree over triangles. Coordinates are kept in single precision: rays should begin near the body.
#[derive(Debug)]
pub struct Bvh {
    nodes: Vec<Node>,
    triangles: Vec<Triangle>,
}

struct Building {
    low: V,
    high: V,
    center: V,
    number: usize,
}

fn area(low: &V, high: &V) -> f64 {
    let s = high - low;
    s.x * s.y + s.y * s.z + s.z * s.x
}

impl Bvh {
    /// The tree over these triangles, each by its corners; O(n log n).
    pub fn new(triangles: &[[V; 3]]) -> Self {
        let mut all: Vec<Building> = (triangles.iter().enumerate())
            .map(|(number, [a, b, c])| {
                let (low, high) = (a.inf(b).inf(c), a.sup(b).sup(c));
                Building { low, high, center: (low + high) / 2.0, number }
            })
            .collect();
        let mut made = Self { nodes: Vec::new(), triangles: Vec::with_capacity(triangles.len()) };
        if !all.is_empty() {
            made.build(&mut all, triangles);
        }
        made
    }

    fn build(&mut self, part: &mut [Building], given: &[[V; 3]]) {
        let (mut low, mut high) = (part[0].low, part[0].high);
        for b in part.iter() {
            (low, high) = (low.inf(&b.low), high.sup(&b.high));
        }
        // Rounded outwards, so that single precision loses no triangle.
        let out = |x: f64, by: f64| (x + by * (1e-6 + 1e-6 * x.abs())) as f32;
        let own = self.nodes.len();
        self.nodes.push(Node {
            low: [0, 1, 2].map(|k| out(low[k], -1.0)),
            high: [0, 1, 2].map(|k| out(high[k], 1.0)),
            next: 0,
            count: 0,
        });
        let middle = if part.len() > LEAF { split(part) } else { None };
        if let Some(middle) = middle {
            let (left, right) = part.split_at_mut(middle);
            self.build(left, given);
            self.nodes[own].next = self.nodes.len() as u32;
            self.build(right, given);
        } else {
            self.nodes[own].next = self.triangles.len() as u32;
            self.nodes[own].count = part.len() as u32;
            for b in part.iter() {
                let [p, q, r] = given[b.number];
                let single = |v: V| [v.x as f32, v.y as f32, v.z as f32];
                let edges = [single(q - p), single(r - p)];
                self.triangles.push(Triangle { corner: single(p), edges, number: b.number as u32 });
            }
        }
    }

    /// The nearest place where the ray meets the surface, from either side, beyond `near` and before `far`.
    pub fn hit(&self, origin: &V, direction: &V, near: f64, far: f64) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        self.walk(origin, direction, near as f32, far as f32, |hit| {
            best = Some(hit);
            true
        });
        best
    }

    /// Whether the ray meets the surface beyond `near`.
    pub fn is_hit(&self, origin: &V, direction: &V, near: f64) -> bool {
        let mut found = false;
        self.walk(origin, direction, near as f32, f32::INFINITY, |_| {
            found = true;
            false
        });
        found
    }

    /// Tells each place that is nearer than those before, until told to end.
    fn walk(&self, origin: &V, direction: &V, near: f32, mut far: f32, mut tell: impl FnMut(Hit) -> bool) {
        if self.nodes.is_empty() {
            return;
        }
        let o = [origin.x as f32, origin.y as f32, origin.z as f32];
        let d = [direction.x as f32, direction.y as f32, direction.z as f32];
        let inverse = d.map(|x| 1.0 / if x.abs() < 1e-20 { 1e-20 } else { x });
        let enters = |node: &Node, far: f32| {
            let (mut first, mut last) = (near, far);
            for k in 0..3 {
                let (a, b) = ((node.low[k] - o[k]) * inverse[k], (node.high[k] - o[k]) * inverse[k]);
                first = first.max(a.min(b));
                last = last.min(a.max(b));
            }
            (first <= last).then_some(first)
        };
        let mut stack = [(0u32, 0f32); 64];
        let mut height = 0;
        if let Some(t) = enters(&self.nodes[0], far) {
            stack[0] = (0, t);
            height = 1;
        }
        while height > 0 {
            height -= 1;
            let (at, t) = stack[height];
            if t > far {
                continue;
            }
            let node = &self.nodes[at as usize];
            if node.count > 0 {
                for triangle in &self.triangles[node.next as usize..][..node.count as usize] {
                    let Some((t, u, v)) = triangle.hit(&o, &d) else { continue };
                    if t > near && t < far {
                        far = t;
                        let weights = [f64::from(u), f64::from(v)];
                        let hit = Hit { t: f64::from(t), triangle: triangle.number as usize, weights };
                        if !tell(hit) {
                            return;
                        }
                    }
                }
                continue;
            }
            let children = [at + 1, node.next];
            let [a, b] = children.map(|c| enters(&self.nodes[c as usize], far));
            let mut push = |child: u32, t: Option<f32>| {
                if let Some(t) = t {
                    stack[height] = (child, t);
                    height += 1;
                }
            };
            // The nearer one comes off the stack first.
            if a.unwrap_or(f32::INFINITY) <= b.unwrap_or(f32::INFINITY) {
                push(children[1], b);
                push(children[0], a);
            } else {
                push(children[0], a);
                push(children[1], b);
            }
        }
    }
}

/// Where to part these, reordered for it; `None` where one leaf costs no more.
fn split(part: &mut [Building]) -> Option<usize> {
    let (mut low, mut high) = (part[0].center, part[0].center);
    for b in part.iter() {
        (low, high) = (low.inf(&b.center), high.sup(&b.center));
    }
    let mut best: Option<(f64, usize, usize)> = None;
    let bin = |b: &Building, k: usize| {
        let share = (b.center[k] - low[k]) / (high[k] - low[k]);
        ((share * BINS as f64) as usize).min(BINS - 1)
    };
    for k in 0..3 {
        if high[k] <= low[k] {
            continue;
        }
        let empty = (V::repeat(f64::INFINITY), V::repeat(f64::NEG_INFINITY), 0usize);
        let mut bins = [empty; BINS];
        for b in part.iter() {
            let it = &mut bins[bin(b, k)];
            *it = (it.0.inf(&b.low), it.1.sup(&b.high), it.2 + 1);
        }
        let cost = |range: &[(V, V, usize)]| {
            let all = range.iter().fold(empty, |a, b| (a.0.inf(&b.0), a.1.sup(&b.1), a.2 + b.2));
            if all.2 == 0 { f64::INFINITY } else { area(&all.0, &all.1) * all.2 as f64 }
        };
        for at in 1..BINS {
            let total = cost(&bins[..at]) + cost(&bins[at..]);
            if total.is_finite() && best.is_none_or(|(least, ..)| total < least) {
                best = Some((total, k, at));
            }
        }
    }
    let (_, k, at) = best?;
    part.sort_unstable_by_key(|b| (bin(b, k) >= at, b.number));
    let middle = part.iter().position(|b| bin(b, k) >= at)?;
    (middle > 0).then_some(middle)
}

impl Triangle {
    /// Möller and Trumbore 1997.
    fn hit(&self, o: &[f32; 3], d: &[f32; 3]) -> Option<(f32, f32, f32)> {
        let cross = |a: &[f32; 3], b: &[f32; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let dot = |a: &[f32; 3], b: &[f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let [e1, e2] = &self.edges;
        let p = cross(d, e2);
        let determinant = dot(e1, &p);
        if determinant.abs() < 1e-20 {
            return None;
        }
        let s = [o[0] - self.corner[0], o[1] - self.corner[1], o[2] - self.corner[2]];
        let u = dot(&s, &p) / determinant;
        // A hair's breadth over each edge, so that no ray passes between two neighbours.
        let slack = 1e-5;
        if !(-slack..=1.0 + slack).contains(&u) {
            return None;
        }
        let q = cross(&s, e1);
        let v = dot(d, &q) / determinant;
        if v < -slack || u + v > 1.0 + slack {
            return None;
        }
        Some((dot(e2, &q) / determinant, u, v))
    }
}
