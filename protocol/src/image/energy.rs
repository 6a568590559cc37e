//! Geometric energies of pairs of parts: a density of the fixed part on a lattice, and charges of the moving one.
//!
//! With ρ(p) the lattice's density at p, interpolated, and qᵢ the charges at the places aᵢ of the moving part, a pose X of it relative to the fixed part
//! has the energy E(X) = −Σ Re(ρ(X·aᵢ)·qᵢ), in units of its depth at the fit: −1 there. Source: M. Behandish, H. Ilieş, *Peg-in-Hole Revisited*, JCISE
//! 15(4), 2015, eqs. 8 and 11; `host/energy` states how density and charges are made.

use bytemuck::{Pod, Zeroable};

use super::records::Section;

/// Depths at which [`EnergyRecord`] states a stiffness: from the energy 0 in equal steps to that of the fit.
pub const ENERGY_DEPTHS: usize = 8;

/// Where an image's energies are; [`super::Header::energies`] leads to it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct EnergyBlock {
    /// [`EnergyRecord`]s.
    pub energies: Section,
    /// [`ChargeRecord`]s.
    pub charges: Section,
    /// Nodes of the lattices: real and imaginary part of the density, each one byte.
    pub nodes: Section,
}

/// Geometric energy of one part in the density of another.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct EnergyRecord {
    /// Index of the moving part.
    pub moving: u16,
    /// Index of the fixed part.
    pub fixed: u16,
    /// Its lattice's nodes, x fastest.
    pub first_node: u32,
    /// Its charges.
    pub first_charge: u32,
    /// Number of charges.
    pub charge_count: u32,
    /// Place of the lattice's first node, fixed part's frame, m.
    pub origin: [f32; 3],
    /// Distance of its nodes, m.
    pub step: f32,
    /// Numbers of nodes along x, y and z.
    pub size: [u16; 3],
    /// Zero.
    pub reserved: u16,
    /// Largest force at any pose about the way, over the depth, 1/m.
    pub largest_force: f32,
    /// Direction of the way, fixed part's frame.
    pub way: [f32; 3],
    /// Majorising stiffness across the way at each depth, over the depth, 1/m².
    pub across: [f32; ENERGY_DEPTHS],
    /// The same along the way, 1/m².
    pub along: [f32; ENERGY_DEPTHS],
    /// The same in rotation about the moving part's centre of mass, 1/rad².
    pub turning: [f32; ENERGY_DEPTHS],
}

/// A charge of a moving part.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ChargeRecord {
    /// Its place, moving part's frame, m.
    pub at: [f32; 3],
    /// Its real and imaginary part, per unit of the lattice's nodes.
    pub charge: [f32; 2],
}

/// An energy of an image with its arrays.
#[derive(Clone, Copy, Debug)]
pub struct Energy<'a> {
    /// Parts, lattice and stiffness.
    pub record: &'a EnergyRecord,
    /// Charges of the moving part.
    pub charges: &'a [ChargeRecord],
    /// Nodes of the lattice.
    pub(super) nodes: &'a [[i8; 2]],
}

impl EnergyRecord {
    /// Number of the lattice's nodes.
    pub fn node_count(&self) -> u64 {
        self.size.iter().map(|&n| u64::from(n)).product()
    }

    /// Whether all its numbers are finite, the lattice has a cell, and the direction is of unit length.
    pub(super) fn is_usable(&self) -> bool {
        let finite = |values: &[f32]| values.iter().all(|v| v.is_finite());
        let not_negative = |values: &[f32]| values.iter().all(|v| *v >= 0.0);
        let [x, y, z] = self.way;
        finite(&self.origin)
            && finite(&self.way)
            && (x * x + y * y + z * z - 1.0).abs() < 1e-3
            && self.step.is_finite()
            && self.step > 0.0
            && (1.0 / self.step).is_finite()
            && self.size.iter().all(|n| *n >= 2)
            && self.largest_force.is_finite()
            && self.largest_force > 0.0
            && (1.0 / self.largest_force).is_finite()
            && [self.across, self.along, self.turning]
                .iter()
                .all(|row| finite(row) && not_negative(row))
    }
}

impl<'a> Energy<'a> {
    /// An energy outside of an image: for what makes one. `None` unless the lattice has the record's nodes and the record's numbers are usable.
    pub fn new(record: &'a EnergyRecord, charges: &'a [ChargeRecord], nodes: &'a [[i8; 2]]) -> Option<Self> {
        (record.is_usable() && record.node_count() == nodes.len() as u64).then_some(Self {
            record,
            charges,
            nodes,
        })
    }

    /// Re(ρ·q) and its derivatives at a place of the lattice, in steps from its first node: trilinear between the nodes. `None` beyond the lattice, where
    /// ρ is zero. Cost with the charge's place and the sums of a tick: some 230 instructions on a Cortex-M7, fewer beyond the lattice.
    #[inline]
    pub fn at(&self, place: [f32; 3], [re, im]: [f32; 2]) -> Option<(f32, [f32; 3])> {
        let [width, height, depth] = self.record.size.map(usize::from);
        let [x, y, z] = place;
        if !(x >= 0.0 && y >= 0.0 && z >= 0.0) {
            return None;
        }
        // Below 65536 after the next check; a larger one saturates.
        let [i, j, k] = place.map(|v| v as u32 as usize);
        if i + 1 >= width || j + 1 >= height || k + 1 >= depth {
            return None;
        }
        let [x, y, z] = [x - i as f32, y - j as f32, z - k as f32];
        let first = i + width * (j + height * k);
        let row = |at: usize| {
            let [a, b] = self.nodes.get(at..)?.first_chunk::<2>()?;
            let product = |node: &[i8; 2]| f32::from(node[0]) * re - f32::from(node[1]) * im;
            let (a, b) = (product(a), product(b));
            // The value on the row, and its derivative along it.
            Some((a + x * (b - a), b - a))
        };
        let next = first + width * height;
        let (a, da) = row(first)?;
        let (b, db) = row(first + width)?;
        let (c, dc) = row(next)?;
        let (d, dd) = row(next + width)?;
        let (low, high) = (a + y * (b - a), c + y * (d - c));
        let (low_x, high_x) = (da + y * (db - da), dc + y * (dd - dc));
        let (low_y, high_y) = (b - a, d - c);
        Some((
            low + z * (high - low),
            [
                low_x + z * (high_x - low_x),
                low_y + z * (high_y - low_y),
                high - low,
            ],
        ))
    }
}
