"""exact series at each touch: truncation and interpolation errors apart"""
import sys; sys.path.insert(0,'/tmp/trust')
from feat import *
import trust, viscera as vs
from viscera._core import touch_series
from viscera.touch import load_bytes
def run(which,k,limit=None,maxo=5):
    cases=trust.tuning() if which=='tuning' else trust.study()
    c=cases[k]; organ=vs.Organ(c.mesh(),c.law,fixed=c.fixed,element=c.element)
    m,rows,fs=load(which,k); touch=load_bytes(open(f'/tmp/trust/{which}{k}.viscera','rb').read())
    exp=np.array([(i,j,n-i-j) for n in range(1,maxo+1) for i in range(n,-1,-1) for j in range(n-i,-1,-1)]); deg=exp.sum(1)
    out=[]; last=None
    P=m.P
    for r,f in zip(rows,fs):
        if last is None or not np.array_equal(last,r.point):
            if limit and len(out)>=limit: break
            last=r.point; patch=touch.patch(r.point)
            U,F=touch_series(organ._body,[patch],np.zeros_like(touch.mesh.points),maxo)[0]
            U=U.reshape(len(exp),-1)
        mon=np.prod(r.push**exp,axis=1); oh=(deg[:,None]==np.arange(1,maxo+1))*mon[:,None]
        u=oh.T@U; fo=oh.T@F
        w=weights(u[:P]); up=w@u[:P]; fp=w@fo[:P]; w5=weights(u); u5=w5@u; f5=w5@fo
        a=touch(r.point,r.push); ua=a.displacement.ravel()
        n=np.linalg.norm
        out.append(dict(int_s=n(ua-up)/n(up),int_f=n(a.force-fp)/n(fp),nxt_s=n(up-u5)/n(u5),nxt_f=n(fp-f5)/n(f5),un=n(u,axis=1)))
    return rows[:len(out)],fs[:len(out)],out
if __name__=='__main__':
    for k in map(int,sys.argv[2].split(',')):
        res=run(sys.argv[1],k,*(int(x) for x in sys.argv[3:])); pickle.dump(res,open(f'/tmp/trust/{sys.argv[1]}{k}.dec','wb'))
        rows,fs,out=res
        for dep in trust.DEPTHS:
            ix=[i for i,r in enumerate(rows) if abs(r.depth-dep)<1e-9 and r.is_stable]
            md=lambda x: f"{100*np.median(x):.3f}/{100*np.quantile(x,.9):.3f}"
            print(f"{k} {dep:.3f} n={len(ix)} err s {md([rows[i].shape_error for i in ix])} f {md([rows[i].force_error for i in ix])} | int s {md([out[i]['int_s'] for i in ix])} f {md([out[i]['int_f'] for i in ix])} | next s {md([out[i]['nxt_s'] for i in ix])} f {md([out[i]['nxt_f'] for i in ix])} | est trunc {md([fs[i]['trunc'] for i in ix])} cor {md([fs[i]['cor'] for i in ix])} comp {md([fs[i]['comp'] for i in ix])} est f {md([fs[i]['est_f'] for i in ix])}")
