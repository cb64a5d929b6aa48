//! Pieces of the labels: voxels of one label that are joined by faces, edges or corners.

use rayon::prelude::*;
use std::collections::BTreeSet;

/// A group of joined voxels is stray if it has less than this share of each of its labels.
const LEAST_SHARE: f64 = 0.05;
/// The piece of a voxel without a label.
const NONE: u32 = u32::MAX;

/// The pieces in a grid.
#[derive(Default)]
pub struct Pieces {
    /// The piece of each voxel; [`NONE`] without a label.
    number: Vec<u32>,
    /// Label of each piece.
    pub label: Vec<usize>,
    /// Volume of each piece [m^3].
    pub volume: Vec<f64>,
    /// For each piece the lowest one that voxels join it to, whatever their labels.
    pub body: Vec<usize>,
    /// Whether a piece lies in a body that is stray.
    pub is_stray: Vec<bool>,
}

/// Whether some volumes are less than a small share of each label's.
pub fn is_small(volumes: &[f64], total: &[f64]) -> bool {
    volumes.iter().zip(total).all(|(v, t)| *v < LEAST_SHARE * t.max(1e-300))
}

impl Pieces {
    /// The pieces of the labels that `place` gives voxels; `volumes` are the labels' [m^3], `voxel` is that of a voxel.
    pub fn new(
        dims: [usize; 3],
        place: impl Fn(usize) -> Option<usize> + Sync,
        volumes: &[f64],
        voxel: f64,
    ) -> Self {
        let n = dims[0] * dims[1] * dims[2];
        let label = |voxel| place(voxel).map(|label| label as u8);
        let held: Vec<Option<u8>> = (0..n).into_par_iter().map(label).collect();
        let mut pieces = Pieces { number: vec![NONE; n], ..Pieces::default() };
        for start in 0..n {
            if held[start].is_some() && pieces.number[start] == NONE {
                pieces.fill(dims, &held, start, voxel);
            }
        }
        for piece in 0..pieces.body.len() {
            pieces.body[piece] = pieces.root(piece);
        }
        let mut of_body = vec![Vec::new(); pieces.body.len()];
        for (piece, &body) in pieces.body.iter().enumerate() {
            of_body[body].resize(volumes.len(), 0.0);
            of_body[body][pieces.label[piece]] += pieces.volume[piece];
        }
        pieces.is_stray =
            pieces.body.iter().map(|&body| is_small(&of_body[body], volumes)).collect();
        pieces
    }

    /// The piece at a voxel.
    pub fn at(&self, voxel: usize) -> Option<usize> {
        Some(self.number[voxel]).filter(|&piece| piece != NONE).map(|piece| piece as usize)
    }

    /// Numbers the voxels of the piece that begins at one. Pieces that were found before and touch it join its body.
    fn fill(&mut self, dims: [usize; 3], held: &[Option<u8>], start: usize, voxel_volume: f64) {
        let piece = self.label.len();
        self.number[start] = piece as u32;
        let mut open = vec![start];
        let mut count = 0_usize;
        let mut touched = BTreeSet::new();
        while let Some(voxel) = open.pop() {
            count += 1;
            around(dims, voxel, |next| match self.number[next] {
                NONE if held[next] == held[start] => {
                    self.number[next] = piece as u32;
                    open.push(next);
                }
                other if other as usize != piece && other != NONE => {
                    touched.insert(other as usize);
                }
                _ => {}
            });
        }
        self.label.push(held[start].map_or(0, usize::from));
        self.volume.push(count as f64 * voxel_volume);
        self.body.push(piece);
        for other in touched {
            let (a, b) = (self.root(piece), self.root(other));
            self.body[a.max(b)] = a.min(b);
        }
    }

    fn root(&self, mut piece: usize) -> usize {
        while self.body[piece] != piece {
            piece = self.body[piece];
        }
        piece
    }
}

/// The voxels around one.
fn around([nx, ny, nz]: [usize; 3], voxel: usize, mut visit: impl FnMut(usize)) {
    let near = |i: usize, n: usize| i.saturating_sub(1)..(i + 2).min(n);
    for i in near(voxel / (ny * nz), nx) {
        for j in near(voxel / nz % ny, ny) {
            for k in near(voxel % nz, nz) {
                visit((i * ny + j) * nz + k);
            }
        }
    }
}
