//! Parts grouped by the place where they are summed.

/// Parts to be summed at each place, in the order in which they were given.
pub(crate) struct Gathered<T> {
    pub starts: Vec<u32>,
    pub parts: Vec<T>,
}

impl<T: Copy + Default> Gathered<T> {
    pub fn new(places: usize, given: &[(usize, T)]) -> Self {
        let mut starts = vec![0u32; places + 1];
        given.iter().for_each(|(place, _)| starts[place + 1] += 1);
        (0..places).for_each(|k| starts[k + 1] += starts[k]);
        let (mut next, mut parts) = (starts.clone(), vec![T::default(); starts[places] as usize]);
        for &(place, part) in given {
            parts[next[place] as usize] = part;
            next[place] += 1;
        }
        Gathered { starts, parts }
    }
}
