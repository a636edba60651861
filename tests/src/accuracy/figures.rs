//! Many numbers -> one that says how they are. Of no numbers there is none.

/// The mean.
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// The root of the mean square.
pub fn rms(values: &[f64]) -> Option<f64> {
    let squares: Vec<f64> = values.iter().map(|v| v * v).collect();
    mean(&squares).map(f64::sqrt)
}

/// The value that a share of all values does not exceed: the one of that rank, rounded up.
pub fn quantile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied()
}

/// As many are greater as are smaller.
pub fn median(values: &[f64]) -> Option<f64> {
    quantile(values, 0.5)
}

/// The greatest.
pub fn worst(values: &[f64]) -> Option<f64> {
    quantile(values, 1.0)
}

/// The part for which something holds, in percent.
pub fn percent_true(values: &[bool]) -> Option<f64> {
    let n_true = values.iter().filter(|is_true| **is_true).count();
    (!values.is_empty()).then(|| 100.0 * n_true as f64 / values.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_four_numbers() {
        let values = [3.0, -1.0, 2.0, 0.0];
        assert_eq!(mean(&values), Some(1.0));
        assert_eq!(rms(&values), Some(3.5f64.sqrt()));
        assert_eq!((median(&values), quantile(&values, 0.95)), (Some(0.0), Some(3.0)));
        assert_eq!((worst(&values), worst(&[])), (Some(3.0), None));
        assert_eq!(percent_true(&[true, false]), Some(50.0));
        assert_eq!((mean(&[]), percent_true(&[])), (None, None));
    }
}
