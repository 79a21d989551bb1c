//! The joint fit of everything that was chosen, in parts that cut no block of neighbouring poses: log scores of blocks that the fit did not
//! see, and what disjoint parts say of the same coefficients.

use trical_ident::folds::{FOLDS, Folds};

use crate::linear::{Design, Partition};
use crate::probability::{Replication, replication};
use crate::settings::PARTS_BY_ROWS;

/// A joint fit in parts, and the scores of what each part says of itself by the others.
pub(crate) struct Parts<'a> {
    partition: Partition<'a>,
    block_of_row: Vec<usize>,
    blocks: usize,
    /// Of a row that the fit did not see.
    variance: f64,
    temper: f64,
}

impl<'a> Parts<'a> {
    pub(crate) fn new(design: &'a Design, set: &[usize], folds: &Folds, temper: f64) -> Option<Self> {
        let fold_of_block = folds.fold_of_blocks(FOLDS);
        let part_of = |pose: usize| fold_of_block.get(folds.block_of(pose)).copied().unwrap_or(0);
        let partition = Partition::new(design, set, FOLDS, &part_of)?;
        let block_of_row = partition.pose_of_row().iter().map(|pose| folds.block_of(*pose)).collect();
        let full = partition.instead(&[], None);
        let seen: Vec<f64> = full.into_iter().filter(|r| r.is_finite()).collect();
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let variance = seen.iter().map(|r| r * r).sum::<f64>() / seen.len().max(1) as f64;
        (variance > 0.0).then_some(Self { partition, block_of_row, blocks: folds.blocks(), variance, temper })
    }

    /// Log score of each block without the candidates `out` and with `add` in their place.
    pub(crate) fn scores(&self, out: &[usize], add: Option<usize>) -> Vec<f64> {
        let mut scores = vec![0.0; self.blocks];
        for (r, block) in self.partition.instead(out, add).iter().zip(&self.block_of_row) {
            // a fit that failed predicts nothing: as bad as can be
            let square = if r.is_finite() { r * r } else { 1e6 * self.variance };
            scores[*block] -= 0.5 * self.temper * square / self.variance;
        }
        scores
    }

    /// Coefficients of some members from disjoint parts, compared: from each of four parts, or from halves where a part has few rows
    /// beside its parameters.
    pub(crate) fn replication(&self, members: &[usize], parameters: usize) -> Replication {
        let least = self.partition.sizes().into_iter().min().unwrap_or(0);
        let groups: Vec<Vec<usize>> = if least >= PARTS_BY_ROWS * parameters {
            (0..FOLDS).map(|k| vec![k]).collect()
        } else {
            vec![(0..FOLDS / 2).collect(), (FOLDS / 2..FOLDS).collect()]
        };
        replication(&self.partition.apart(members, &groups), self.variance / self.temper)
    }
}
