//! Leaving out what no face uses.

/// Removes the vertices that no face uses and numbers the others anew, in order.
pub(crate) fn drop_unused<V>(vertices: &mut Vec<V>, faces: &mut [[u32; 3]]) {
    let numbers = used(vertices.len(), faces);
    keep(vertices, &numbers);
    faces.iter_mut().for_each(|face| *face = face.map(|v| numbers[v as usize]));
}

/// The new number of every vertex that a face uses, `u32::MAX` for the others.
pub(crate) fn used(count: usize, faces: &[[u32; 3]]) -> Vec<u32> {
    let mut numbers = vec![u32::MAX; count];
    faces.iter().flatten().for_each(|&v| numbers[v as usize] = 0);
    for (next, number) in (0..).zip(numbers.iter_mut().filter(|n| **n == 0)) {
        *number = next;
    }
    numbers
}

/// Keeps the values of the vertices that have a number.
pub(crate) fn keep<V>(values: &mut Vec<V>, numbers: &[u32]) {
    let mut numbers = numbers.iter();
    values.retain(|_| numbers.next().is_some_and(|&n| n != u32::MAX));
}
