//! Connected components of a graph.

/// The connected components of a graph, the largest first and of equal ones that with the smallest node; nodes in each ascending.
///
/// # Panics
/// When an edge names a node that does not exist.
#[must_use]
pub fn components(nodes: usize, edges: impl IntoIterator<Item = (usize, usize)>) -> Vec<Vec<usize>> {
    let mut parent: Vec<usize> = (0..nodes).collect();
    for (a, b) in edges {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        // The smaller is the root, so that roots do not depend on the order of the edges.
        parent[a.max(b)] = a.min(b);
    }
    let mut members = vec![Vec::new(); nodes];
    for node in 0..nodes {
        members[root(&mut parent, node)].push(node);
    }
    let mut found: Vec<Vec<usize>> = members.into_iter().filter(|m| !m.is_empty()).collect();
    found.sort_by_key(|m| (std::cmp::Reverse(m.len()), m[0]));
    found
}

/// The root of a node; the path to it is halved on the way.
pub(super) fn root(parent: &mut [usize], mut node: usize) -> usize {
    while parent[node] != node {
        parent[node] = parent[parent[node]];
        node = parent[node];
    }
    node
}
