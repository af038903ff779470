//! Pairs of least total cost: the assignment problem by shortest paths (Kuhn, Munkres; Jonker and
//! Volgenant).

/// Returns a column for each row, so that the sum of the costs is least; every row has one if there
/// are at least as many columns.
pub fn least_cost(rows: usize, columns: usize, cost: &dyn Fn(usize, usize) -> f64) -> Vec<Option<usize>> {
    if rows > columns {
        let of_columns = least_cost(columns, rows, &|c, r| cost(r, c));
        let mut of_rows = vec![None; rows];
        for (column, row) in of_columns.into_iter().enumerate() {
            if let Some(row) = row {
                of_rows[row] = Some(column);
            }
        }
        return of_rows;
    }
    // Column 0 is the start of a row's path; rows and columns count from 1.
    let (mut of_row, mut of_column) = (vec![0.0; rows + 1], vec![0.0; columns + 1]);
    let mut row_of = vec![0; columns + 1];
    for row in 1..=rows {
        row_of[0] = row;
        let (mut least, mut from) = (vec![f64::INFINITY; columns + 1], vec![0; columns + 1]);
        let mut used = vec![false; columns + 1];
        let mut at = 0;
        while row_of[at] != 0 {
            used[at] = true;
            let (current, mut step, mut next) = (row_of[at], f64::INFINITY, 0);
            for column in (1..=columns).filter(|c| !used[*c]) {
                let reduced = cost(current - 1, column - 1) - of_row[current] - of_column[column];
                if reduced < least[column] {
                    (least[column], from[column]) = (reduced, at);
                }
                if least[column] < step {
                    (step, next) = (least[column], column);
                }
            }
            for column in 0..=columns {
                if used[column] {
                    of_row[row_of[column]] += step;
                    of_column[column] -= step;
                } else {
                    least[column] -= step;
                }
            }
            at = next;
        }
        while at != 0 {
            row_of[at] = row_of[from[at]];
            at = from[at];
        }
    }
    let mut found = vec![None; rows];
    for column in (1..=columns).filter(|c| row_of[*c] != 0) {
        found[row_of[column] - 1] = Some(column - 1);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the least cost by trying every order of a few columns.
    fn by_trial(costs: &[[f64; 5]], row: usize, taken: u32) -> f64 {
        if row == costs.len() {
            return 0.0;
        }
        let free = (0..5).filter(|c| taken >> c & 1 == 0);
        let of_column = |c: usize| costs[row][c] + by_trial(costs, row + 1, taken | 1 << c);
        free.map(of_column).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn no_other_pairs_cost_less() {
        let mut random = stylet_random::Random(1);
        for rows in 1..=5 {
            for _ in 0..40 {
                let costs: Vec<[f64; 5]> = (0..rows).map(|_| std::array::from_fn(|_| random.unit())).collect();
                let found = least_cost(rows, 5, &|r, c| costs[r][c]);
                let sum: f64 = found.iter().enumerate().map(|(r, c)| costs[r][c.unwrap()]).sum();
                assert!((sum - by_trial(&costs, 0, 0)).abs() < 1e-6);
                // The same pairs with rows and columns exchanged.
                let turned = least_cost(5, rows, &|c, r| costs[r][c]);
                assert_eq!(turned.iter().flatten().count(), rows);
                for (row, column) in found.iter().enumerate() {
                    assert_eq!(turned[column.unwrap()], Some(row));
                }
            }
        }
    }
}
