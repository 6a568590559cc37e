//! Printed results of Faas 2010: tables 3 to 6 and figure 35, with which Mortise's results are compared.

use super::statistics::chi_squared_p;

/// A term of table 3, ordinal logistic model of 27 trials.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Printed {
    /// Source of variation, as printed.
    pub source: &'static str,
    /// χ², or F in table 5.
    pub statistic: f64,
    /// p, as printed.
    pub p: f64,
}

/// Table 3: factors of the first study in the order of [`super::shrink::FACTORS`].
pub const TABLE_3: [Printed; 4] = [
    Printed {
        source: "Peg voxel size (mm)",
        statistic: 0.598,
        p: 0.4395,
    },
    Printed {
        source: "Hole voxel size (mm)",
        statistic: 0.869,
        p: 0.3513,
    },
    Printed {
        source: "Clearance",
        statistic: 4.646,
        p: 0.0311,
    },
    Printed {
        source: "Pointshell shrinking",
        statistic: 3.209,
        p: 0.0732,
    },
];

/// Table 4: degrees of freedom and sums of squares of the model, the error and the total.
pub const TABLE_4: [(&str, usize, f64); 3] =
    [("Model", 2, 0.112), ("Error", 15, 0.040), ("Total", 17, 0.154)];
/// F ratio of table 4.
pub const TABLE_4_F: f64 = 21.250;
/// R² of the same model, as stated in the text.
pub const R_SQUARED: f64 = 0.7391;

/// Table 5: F of the effects; both p are printed as < 0.001.
pub const TABLE_5: [Printed; 2] = [
    Printed {
        source: "Peg diameter (mm)",
        statistic: 29.989,
        p: 0.001,
    },
    Printed {
        source: "Hole diameter (mm)",
        statistic: 33.139,
        p: 0.001,
    },
];

/// Eq. 20: voxel size over the difference of the diameters, and the constant. Units are not stated.
pub const EQ_20: (f64, f64) = (0.027, -0.001);

/// Table 6: voxels of the block with the hole of 0.7 m, of the peg of 0.65 m and of that of 0.69 m, at 10 mm.
pub const TABLE_6: [(&str, u32); 3] = [("block", 81_448), ("peg 650 mm", 32_868), ("peg 690 mm", 35_304)];

/// Fig. 35, low clearance: lowest update rate of the three cases, Hz: voxmaps alone and without constraint evaluation “above 800”, with it “dropped
/// to 100”.
pub const FIG_35_HZ: [f64; 3] = [800.0, 800.0, 100.0];

/// True if the p of a term of table 3 is that of its χ² with one degree of freedom.
pub fn is_chi_squared_of_one(term: &Printed) -> bool {
    chi_squared_p(term.statistic, 1.0).is_some_and(|p| (p - term.p).abs() < 5e-4)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The text states a one-tailed t-test; the numbers are tails of χ² with one degree of freedom, as for an effect's likelihood ratio.
    #[test]
    fn table_3_has_tails_of_chi_squared() {
        assert!(TABLE_3.iter().all(is_chi_squared_of_one));
    }

    /// Eighteen voxel sizes of 2.0 and 0.4 mm, k of them the one, have a sum of squares of k·(18 − k)/18·1.6² mm² about their mean. No k gives the
    /// printed 0.154 in mm², in cm², or in square inches: the response of table 4 had other values, or another unit.
    #[test]
    fn table_4_is_not_of_two_voxel_sizes() {
        for unit_mm in [1.0, 10.0, 25.4] {
            let sums = (1..18).map(|k| f64::from(k * (18 - k)) / 18.0 * (1.6f64 / unit_mm).powi(2));
            assert!(sums.into_iter().all(|sum| (sum - TABLE_4[2].2).abs() > 0.03));
        }
    }

    /// Model and error sum to the total within rounding and a unit of the last digit; F, R² and the degrees of freedom are consistent.
    #[test]
    fn table_4_belongs_together() {
        let [model, error, total] = TABLE_4.map(|row| row.2);
        assert!((model + error - total).abs() < 2.1e-3);
        assert!((R_SQUARED - model / (model + error)).abs() < 5e-3);
        // 0.040 stands for 0.0395 to 0.0405, 0.112 for 0.1115 to 0.1125.
        let f = |model: f64, error: f64| model / 2.0 / (error / 15.0);
        assert!((f(0.1115, 0.0405)..f(0.1125, 0.0395)).contains(&TABLE_4_F));
    }
}
