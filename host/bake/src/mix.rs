//! Choice of one field for each shape when the best ones of all do not fit together.

use crate::trials::Rated;

/// For each shape the number of one of its fields, which are sorted by bytes, so that the largest error is as small as `room` bytes allow: from the
/// smallest fields on, the one of the largest error is replaced by the next better one that fits. `None` where a shape has no field.
pub(crate) fn mix(rated: &[Vec<Rated>], room: u64) -> Option<Vec<usize>> {
    let mut chosen: Vec<Rated> = (rated.iter())
        .map(|fields| fields.first().copied())
        .collect::<Option<_>>()?;
    let mut open: Vec<usize> = (0..rated.len()).collect();
    while let Some(&worst) = open
        .iter()
        .max_by(|&&a, &&b| chosen[a].excess.total_cmp(&chosen[b].excess))
    {
        let bytes: u64 = chosen.iter().map(|field| field.bytes).sum();
        let left = (room + chosen[worst].bytes).saturating_sub(bytes);
        let better =
            (rated[worst].iter()).find(|field| field.excess < chosen[worst].excess && field.bytes <= left);
        match better {
            Some(field) => chosen[worst] = *field,
            None => open.retain(|&other| other != worst),
        }
    }
    Some(chosen.iter().map(|field| field.number).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rated(fields: &[(u64, f64)]) -> Vec<Rated> {
        let rated = |(number, &(bytes, excess)): (usize, &(u64, f64))| Rated {
            number,
            bytes,
            excess,
        };
        fields.iter().enumerate().map(rated).collect()
    }

    proptest! {
        /// Against all combinations: none that fits has a smaller largest error, where larger fields err less.
        #[test]
        fn no_combination_that_fits_is_better(
            shapes in prop::collection::vec(prop::collection::vec((1u64..100, 0.0f64..1.0), 1..5), 1..4),
            room in 0u64..300,
        ) {
            let all: Vec<Vec<Rated>> = (shapes.into_iter())
                .map(|mut fields| {
                    let mut errors: Vec<f64> = fields.iter().map(|field| field.1).collect();
                    errors.sort_by(|a, b| b.total_cmp(a));
                    fields.sort_by_key(|field| field.0);
                    for (field, error) in fields.iter_mut().zip(errors) {
                        field.1 = error;
                    }
                    rated(&fields)
                })
                .collect();
            let chosen = mix(&all, room).unwrap();
            let worst = |of: &[usize]| all.iter().zip(of).map(|(f, &i)| f[i].excess).fold(0.0, f64::max);
            let bytes = |of: &[usize]| all.iter().zip(of).map(|(f, &i)| f[i].bytes).sum::<u64>();
            let smallest = vec![0; all.len()];
            prop_assert!(bytes(&chosen) <= room.max(bytes(&smallest)));
            let mut every: Vec<Vec<usize>> = vec![Vec::new()];
            for fields in &all {
                every = (every.iter())
                    .flat_map(|of| (0..fields.len()).map(move |i| [of.clone(), vec![i]].concat()))
                    .collect();
            }
            for other in every.iter().filter(|other| bytes(other) <= room) {
                prop_assert!(worst(&chosen) <= worst(other), "{chosen:?} {other:?}");
            }
        }
    }

    #[test]
    fn a_shape_without_a_field_has_no_mix() {
        assert_eq!(mix(&[rated(&[(1, 0.0)]), Vec::new()], 10), None);
        assert_eq!(mix(&[], 0), Some(Vec::new()));
    }
}
