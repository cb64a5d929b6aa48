//! Parts grouped by the place where they are summed.

/// Parts to be summed at each place, in the order in which they were given.
pub(crate) struct Gathered<T> {
    pub starts: Vec<u32>,
    pub parts: Vec<T>,
}

/// In place of a place: the part is summed elsewhere.
pub(crate) const ELSEWHERE: u32 = u32::MAX;

impl Gathered<u32> {
    /// Part number `k` goes to the place `places[k]`.
    pub fn by_number(n_places: usize, places: &[u32]) -> Self {
        let own = || (0u32..).zip(places).filter(|(_, place)| **place != ELSEWHERE);
        let mut starts = vec![0u32; n_places + 1];
        own().for_each(|(_, &place)| starts[place as usize + 1] += 1);
        (0..n_places).for_each(|k| starts[k + 1] += starts[k]);
        let (mut next, mut parts) = (starts.clone(), vec![0; starts[n_places] as usize]);
        for (part, &place) in own() {
            let place = &mut next[place as usize];
            parts[*place as usize] = part;
            *place += 1;
        }
        Gathered { starts, parts }
    }
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
