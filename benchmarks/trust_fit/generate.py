import sys, pickle, time
sys.path.insert(0,'/work/wt/trust/benchmarks')
import trust, numpy as np
which = sys.argv[1]; pts=int(sys.argv[2])
cases = trust.tuning() if which=='tuning' else trust.study()
sel = [int(x) for x in sys.argv[3].split(',')] if len(sys.argv)>3 else range(len(cases))
for k in sel:
    c=cases[k]; t0=time.perf_counter()
    touch=c.reduce(); t1=time.perf_counter()
    rows=trust.ask(touch, pts, 1000+k); t2=time.perf_counter()
    open(f'/tmp/trust/{which}{k}.viscera','wb').write(touch._model.to_bytes())
    pickle.dump(rows, open(f'/tmp/trust/{which}{k}.pkl','wb'))
    n=len(touch.mesh.points)
    tr=[r for r in rows if r.is_force_trusted and r.is_shape_trusted]
    bad=[r for r in tr if max(r.force_error,r.shape_error)>r.allowance]
    right=[r for r in rows if r.is_stable and max(r.force_error,r.shape_error)<=r.allowance]
    print(k,c,n,touch.summary()['positions'],f"reduce {t1-t0:.0f}s ask {t2-t1:.0f}s rows {len(rows)} trusted {len(tr)} beyond {len(bad)} worst {max([max(r.force_error,r.shape_error)/r.allowance for r in tr],default=0):.2f} right {len(right)} untrusted {1-len([r for r in right if r.is_force_trusted and r.is_shape_trusted])/max(1,len(right)):.0%} med est/err {np.median([max(r.force_estimate,r.shape_estimate)/max(r.force_error,r.shape_error) for r in rows]):.1f}",flush=True)
