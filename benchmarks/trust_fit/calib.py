"""interpolation errors at 32 centroids, with features there, no Pade (polynomial, as measure.rs)"""
import sys; sys.path.insert(0,'/tmp/trust')
from interp import *
from types import SimpleNamespace
import os
def go(k,which='tuning',count=32):
    cases=trust.tuning() if which=='tuning' else trust.study(); c=cases[k]; organ=vs.Organ(c.mesh(),c.law,fixed=c.fixed,element=c.element)
    m=M(f'/tmp/trust/{which}{k}.viscera'); touch=load_bytes(open(f'/tmp/trust/{which}{k}.viscera','rb').read())
    nt=len(m.tri); tris=[j*nt//count for j in range(min(count,nt))]
    patches=[touch.patch(m.c[t].mean(0)) for t in tris]
    series=touch_series(organ._body,patches,np.zeros((len(organ.mesh.points),3)),m.P)
    R=[]; n=np.linalg.norm
    dirs=[s*e for e in np.eye(3) for s in (1,-1)]
    for t,(U,F) in zip(tris,series):
        U=U.reshape(m.nt,-1)
        for share in (.25,.5,1.):
            for dd in dirs:
                d=share*m.meta['depth']*dd; x=m.c[t].mean(0)
                f=features(m,SimpleNamespace(point=x,push=d)); a=touch(x,d)
                mon=np.prod(d**m.exp,axis=1); oh=(m.deg[:,None]==np.arange(1,m.P+1))*mon[:,None]; u=oh.T@U; fo=oh.T@F; w=weights(u)
                up=w@u; fp=w@fo
                R.append(dict(share=share,int_s=n(a.displacement.ravel()-up)/n(up),int_f=n(a.force-fp)/n(fp),cor=f['cor'],comp=f['comp'],
                   **{f's{p+1}':f['spread'][p] for p in range(m.P)},**{f'g{p+1}':f['fspread'][p] for p in range(m.P)},**{f'z{p+1}':f['size'][p]/f['size'][0] for p in range(m.P)}))
    pickle.dump({q:np.array([r[q] for r in R]) for q in R[0]},open(f'/tmp/trust/{which}{k}.cal','wb'))
    C={q:np.array([r[q] for r in R]) for q in R[0]}
    for q in ('int_s','int_f'):
        print(k,q,[f"{nm} ratio med {np.median(C[q]/C[nm]):.3f} sd {np.std(np.log(C[q]/C[nm])):.2f}" for nm in ('cor','s2','s3','g2')],flush=True)
for k in map(int,sys.argv[1].split(',')): go(k)
