//! Conjugate gradients whose loops threads share.

use super::*;
use crate::threads::FEWEST;

#[test]
fn large_systems_are_solved_alike_on_any_number_of_threads() {
    let (points, cells) = block([20; 3], [0.1; 3]);
    let held = (0u32..).zip(&points).filter(|(_, x)| x[0] == 0.0);
    let fixed: Vec<u32> = held.flat_map(|(n, _)| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
    let material = Material::new("neo_hookean", vec![vec![1e4, 4e4]]).unwrap();
    let body = Body::new(points, cells, material).unwrap();
    assert!(body.pattern().n_stretches() >= FEWEST);
    let load = noise(body.n_dofs(), 2);
    for preconditioner in
        [Preconditioner::BlockJacobi, Preconditioner::IncompleteCholesky, Preconditioner::Multigrid]
    {
        let method = with(preconditioner, false);
        let [one, two, three] = [1, 2, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let tangent = tangent_of(method, &body, &vec![0.0; load.len()]);
                let mut system =
                    ConstrainedSystem::new(method, &body, fixed.iter().copied(), Vec::new())
                        .unwrap();
                system.prepare(&tangent, 0.0).unwrap();
                let (mut b, mut s) = (load.clone(), vec![0.0; load.len()]);
                let solved = system.solve(&mut b, &[], &mut s, &mut Vec::new(), None).unwrap();
                assert!(solved.is_complete, "{method:?} {solved:?}");
                s
            })
        });
        assert!(one == two && one == three, "{method:?}");
    }
}
