//! Strongly connected components.

const UNSEEN: u32 = u32::MAX;

/// For each of `n` nodes the number of its component; edges never lead to a larger number.
///
/// Tarjan, "Depth-first search and linear graph algorithms", SIAM J. Comput. 1 (1972), without
/// recursion.
pub(crate) fn components<I>(n: usize, successors: impl Fn(usize) -> I) -> Vec<u32>
where
    I: Iterator<Item = usize>,
{
    let mut component = vec![UNSEEN; n];
    let mut index = vec![UNSEEN; n];
    let mut low = vec![0u32; n];
    let mut stack = Vec::new();
    let (mut next_index, mut next_component) = (0u32, 0u32);
    for root in 0..n {
        if index[root] != UNSEEN {
            continue;
        }
        let mut calls = vec![(root, successors(root))];
        index[root] = next_index;
        low[root] = next_index;
        next_index += 1;
        stack.push(root);
        while let Some((node, rest)) = calls.last_mut() {
            let node = *node;
            if let Some(to) = rest.next() {
                if index[to] == UNSEEN {
                    index[to] = next_index;
                    low[to] = next_index;
                    next_index += 1;
                    stack.push(to);
                    calls.push((to, successors(to)));
                } else if component[to] == UNSEEN {
                    low[node] = low[node].min(index[to]);
                }
                continue;
            }
            calls.pop();
            if let Some((parent, _)) = calls.last() {
                low[*parent] = low[*parent].min(low[node]);
            }
            if low[node] == index[node] {
                while let Some(member) = stack.pop() {
                    component[member] = next_component;
                    if member == node {
                        break;
                    }
                }
                next_component += 1;
            }
        }
    }
    component
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_components_in_order() {
        let edges: [&[usize]; 6] = [&[1], &[2, 3], &[0], &[4], &[3, 5], &[]];
        let of = components(6, |q| edges[q].iter().copied());
        assert!(of[0] == of[1] && of[1] == of[2] && of[3] == of[4]);
        assert!(of[0] > of[3] && of[3] > of[5]);
    }

    #[test]
    fn long_chains_need_no_stack() {
        let n = 200_000;
        let of = components(n, |q| (q + 1 < n).then_some(q + 1).into_iter());
        assert_eq!(of[0], n as u32 - 1);
    }
}
