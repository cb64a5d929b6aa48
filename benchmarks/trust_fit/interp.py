"""variants of interpolation against the exact series at the touch"""
import sys; sys.path.insert(0,'/tmp/trust')
from feat import *
import trust, viscera as vs
from viscera._core import touch_series
from viscera.touch import load_bytes
class Fields:
    def __init__(s,m):
        s.m=m; a=m.a; npts=len(a['points']); isf=np.zeros(npts,bool); isf[a['surface_nodes'].ravel()]=True
        s.surf=a['surface_nodes'].ravel(); s.inn=np.flatnonzero(~isf); s.rs=a['region_start'].ravel().astype(int)
        s.pr=a['position_region'].ravel(); s.er=a['edge_region'].ravel(); nm=np.diff(s.rs)
        s.po=np.concatenate([[0],np.cumsum(m.nt*nm[s.pr])]); s.eo=np.concatenate([[0],np.cumsum(m.et*nm[s.er])])
        s.pc=a['position_coefficients'].ravel(); s.ec=a['edge_coefficients'].ravel(); s.npts=npts
        s.sm=a['surface_modes'].reshape(s.rs[-1],-1,3); s.im=a['interior_modes'].reshape(s.rs[-1],-1,3) if len(s.inn) else None
        s.cache={}
    def modes(s,r):
        if r not in s.cache:
            sl=slice(s.rs[r],s.rs[r+1]); out=np.zeros((s.rs[r+1]-s.rs[r],s.npts,3)); sc=s.m.a['mode_scale'].ravel()[sl][:,None,None].astype(float)
            out[:,s.surf]=s.sm[sl]*sc
            if s.im is not None: out[:,s.inn]=s.im[sl]*sc
            s.cache[r]=out.reshape(len(out),-1)
        return s.cache[r]
    def pos(s,p): return s.pc[s.po[p]:s.po[p+1]].reshape(s.m.nt,-1).astype(float)@s.modes(s.pr[p])
    def edge(s,e): return s.ec[s.eo[e]:s.eo[e+1]].reshape(s.m.et,-1).astype(float)@s.modes(s.er[e])
def variants(m,fl,t,w,d):
    cor=m.tri[t]; ed=m.te[t]; P=m.P
    ew=np.array([w[0]*w[1],w[1]*w[2],w[2]*w[0]]); prs=[(0,1),(1,2),(2,0)]
    C=sum(w[k]**2*m.C[cor[k]]+ew[k]*(m.X[ed[k]]+m.X[ed[k]].T) for k in range(3)); K=np.linalg.inv(C); f=K@d
    Ca=[m.C[c] for c in cor]; Ce=[.25*(m.C[cor[i]]+m.C[cor[j]]+m.X[ed[k]]+m.X[ed[k]].T) for k,(i,j) in enumerate(prs)]
    U=[fl.pos(c) for c in cor]; E=[fl.edge(e) for e in ed]
    G=[np.einsum('ij,in->nj',Ca[k],U[k][:3]).T if False else (U[k][:3].T@Ca[k]).T for k in range(3)] # G_a f: (3,n): u_1=U^T d, d=C f
    mon=lambda x: np.prod(x**m.exp,axis=1); oh=m.deg[:,None]==np.arange(1,P+1)
    quad=np.arange(P)<m.Q
    N=np.array([w*(2*w-1) if quad[p] else w for p in range(P)]); NE=np.array([4*ew if quad[p] else 0*ew for p in range(P)])
    out={}
    for name in ('old','da','daC','daCG'):
        da=[d if name=='old' else c@f for c in Ca]; de=[d if name=='old' else c@f for c in Ce]
        fa=[(oh*mon(x)[:,None]).T@m.F[c] for x,c in zip(da,cor)]
        fe=[(oh[3:3+m.et]*mon(x)[3:3+m.et,None]).T@m.EF[e] for x,e in zip(de,ed)]
        if name in('daC','daCG'):
            fo=np.array([K@(sum(N[p,k]*Ca[k]@fa[k][p] for k in range(3))+sum(NE[p,k]*Ce[k]@fe[k][p] for k in range(3))) for p in range(P)])
        else: fo=np.array([sum(N[p,k]*fa[k][p] for k in range(3))+sum(NE[p,k]*fe[k][p] for k in range(3)) for p in range(P)])
        fo[0]=f
        ua=[(oh*mon(x)[:,None]).T@u for x,u in zip(da,U)]
        ue=[(oh[3:3+m.et]*mon(x)[3:3+m.et,None]).T@u for x,u in zip(de,E)]
        u=np.array([sum(N[p,k]*ua[k][p] for k in range(3))+sum(NE[p,k]*ue[k][p] for k in range(3)) for p in range(P)])
        u[0]=sum(w[k]*(f@G[k]) for k in range(3))
        if name=='daCG':
            for p in range(1,P):
                for k in range(3):
                    g=w[k]*fo[p]-N[p,k]*fa[k][p]
                    for e,(i,j) in enumerate(prs):
                        if k in(i,j): g=g-.5*NE[p,e]*fe[e][p]
                    u[p]+=g@G[k]
        out[name]=(u,fo)
    return out
def run(which,k,limit=12):
    cases=trust.tuning() if which=='tuning' else trust.study()
    c=cases[k]; organ=vs.Organ(c.mesh(),c.law,fixed=c.fixed,element=c.element)
    m=M(f'/tmp/trust/{which}{k}.viscera'); rows=pickle.load(open(f'/tmp/trust/{which}{k}.pkl','rb')); touch=load_bytes(open(f'/tmp/trust/{which}{k}.viscera','rb').read())
    fl=Fields(m); last=None; res={}; np_=0
    for r in rows:
        if last is None or not np.array_equal(last,r.point):
            np_+=1
            if np_>limit: break
            last=r.point; patch=touch.patch(r.point)
            U,F=touch_series(organ._body,[patch],np.zeros((len(touch.mesh.points),3)),m.P)[0]; U=U.reshape(m.nt,-1)
        t,w=m.locate(r.point); mon=np.prod(r.push**m.exp,axis=1); oh=(m.deg[:,None]==np.arange(1,m.P+1))*mon[:,None]
        u=oh.T@U; fo=oh.T@F; wt=weights(u); nu=np.linalg.norm(wt@u); nf=np.linalg.norm(wt@fo)
        for name,(ui,fi) in variants(m,fl,t,w,r.push).items():
            e=[np.linalg.norm(wt[p]*(ui[p]-u[p]))/nu for p in range(m.P)]; g=[np.linalg.norm(wt[p]*(fi[p]-fo[p]))/nf for p in range(m.P)]
            res.setdefault((r.depth,name),[]).append([*e,np.linalg.norm(wt@(ui-u))/nu,*g,np.linalg.norm(wt@(fi-fo))/nf])
    for (dep,name),v in sorted(res.items()):
        if dep in(.05,.1): print(k,dep,f"{name:5s}",'s by order',(100*np.median(v,0)[:m.P+1]).round(3),'f',(100*np.median(v,0)[m.P+1:]).round(3), '90%',(100*np.quantile(v,.9,0)[[m.P,-1]]).round(2))
if __name__=="__main__":
  for k in map(int,sys.argv[2].split(',')): run(sys.argv[1],k,int(sys.argv[3]))
