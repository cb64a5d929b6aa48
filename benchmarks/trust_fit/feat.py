import sys, pickle, json, struct
import numpy as np
sys.path.insert(0,'/work/wt/trust/benchmarks')
DT={'F64':'<f8','F32':'<f4','U32':'<u4','I16':'<i2'}
class M:
    def __init__(s, path):
        data=open(path,'rb').read(); n=struct.unpack('<Q',data[:8])[0]; h=json.loads(data[8:8+n]); body=memoryview(data)[8+n:]
        s.meta=json.loads(h['__metadata__']['viscera']); s.a={}
        for k,v in h.items():
            if k=='__metadata__': continue
            o0,o1=v['data_offsets']; s.a[k]=np.frombuffer(body[o0:o1],DT[v['dtype']]).reshape(v['shape'])
        P=s.P=s.meta['order']; s.Q=s.meta['edge_order']
        s.exp=np.array([(i,j,n-i-j) for n in range(1,P+1) for i in range(n,-1,-1) for j in range(n-i,-1,-1)])
        s.deg=s.exp.sum(1); s.nt=len(s.exp); s.et=int((s.deg<=s.Q).sum()-3)
        s.np_=len(s.a['positions'])
        s.tri=s.a['touchable']; s.pos=s.a['points'][s.a['positions']]
        s.te=s.a['triangle_edges']; s.C=s.a['compliance'].reshape(-1,3,3); s.X=s.a['cross_compliance'].reshape(-1,3,3)
        s.F=s.a['force'].reshape(s.np_,s.nt,3); s.EF=s.a['edge_force'].reshape(-1,s.et,3)
        s.S=s.a['sketch'].reshape(s.np_,s.nt,24).astype(float); s.G=s.a['norms'].reshape(s.np_,-1).astype(float)
        c=s.pos[s.tri]; s.c=c; s.nrm=np.cross(c[:,1]-c[:,0],c[:,2]-c[:,0]); s.ar=np.linalg.norm(s.nrm,axis=1); s.nrm/=s.ar[:,None]
        s.comp=s.a['compression'].ravel().astype(float); s.lcomp=s.a['linear_compression'].ravel().astype(float)
    def locate(s,x):
        a,b,c=s.c[:,0],s.c[:,1],s.c[:,2]
        wa=np.einsum('ij,ij->i',np.cross(b-x,c-x),s.nrm)/s.ar; wb=np.einsum('ij,ij->i',np.cross(c-x,a-x),s.nrm)/s.ar
        wc=1-wa-wb; d=np.abs(np.einsum('ij,ij->i',x-a,s.nrm))/np.sqrt(s.ar)
        bad=np.maximum(-np.minimum(np.minimum(wa,wb),wc),0)+d
        t=int(np.argmin(bad)); return t,np.clip(np.array([wa[t],wb[t],wc[t]]),0,1)
def weights(v):
    P=len(v); 
    if P<3: return np.ones(P)
    size=np.linalg.norm(v,axis=1); u=v/size[:,None]
    c=np.linalg.solve(u[:-1]@u[:-1].T+1e-3*np.eye(P-1),-u[:-1]@u[-1])
    s=np.cumsum([1.0,*(c*size[-1]/size[:-1])[::-1]]); D=s[-1]
    if not D>0.1: return np.ones(P)
    t=min((D-.1)/.2,1.0); sh=3*t*t-2*t**3
    return (s[::-1]/D-1)*sh+1
def features(m,row):
    t,w=m.locate(row.point); cor=m.tri[t]; ed=m.te[t]; d=row.push; P=m.P
    ew=np.array([w[0]*w[1],w[1]*w[2],w[2]*w[0]])
    C=sum(w[k]**2*m.C[cor[k]]+ew[k]*(m.X[ed[k]]+m.X[ed[k]].T) for k in range(3)); K=np.linalg.inv(C)
    mon=np.prod(d**m.exp,axis=1); quad=(np.arange(m.nt)<3+m.et)
    cw=np.where(quad[:,None],w*(2*w-1),w)   # (terms,3)
    onehot=(m.deg[:,None]==np.arange(1,P+1)).astype(float)*mon[:,None]  # terms, orders
    Fc=np.einsum('tk,kti->ti',cw,m.F[cor]); 
    Fc[3:3+m.et]+=4*np.einsum('k,kti->ti',ew,m.EF[ed]); Fl=np.einsum('k,kti->ti',w,m.F[cor])
    orders=onehot.T@Fc; orders[0]=K@d
    cororders=onehot.T@(Fc-Fl); cororders[0]=0
    sk=np.einsum('to,kts->kos',onehot,m.S[cor]); v=np.einsum('k,kos->os',w,sk)
    W=[None]*(P+1)
    for p in range(1,P+1): W[p]=np.concatenate([weights(v[:p]),np.zeros(P-p)])
    f=W[P]@orders; nf=np.linalg.norm(f); u=W[P]@v; nu=np.linalg.norm(u)
    o={}
    for p in range(2,P+1):
        dW=W[p]-W[p-1]; o[f'dv{p}']=np.linalg.norm(dW@v)/nu; o[f'df{p}']=np.linalg.norm(dW@orders)/nf
    # norms
    size=np.zeros(P)
    for k in range(3):
        off=0;tm=0
        for p in range(1,P+1):
            n=(p+1)*(p+2)//2; g=m.G[cor[k]][off:off+n*n].reshape(n,n); mm=mon[tm:tm+n]
            size[p-1]+=w[k]*np.sqrt(max(mm@g@mm,0)); off+=n*n; tm+=n
    o['size']=size; o['fo']=np.linalg.norm(orders,axis=1)/nf; o['vo']=np.linalg.norm(v,axis=1)/nu
    rho=max(size[-1]/size[-2],np.sqrt(size[-1]/size[-3]))/(1-1.5/P); o['rho']=rho
    tail=rho/(1-rho) if rho<.9 else np.inf
    o['poly']=max(tail*size[-1]/size[0],tail*np.linalg.norm(orders[-1])/nf)
    o['cor']=np.linalg.norm(cororders.sum(0))/nf; o['coro']=np.linalg.norm(cororders,axis=1)/nf
    wp=W[P]
    o['spread']=np.array([np.sqrt(sum(w[k]*np.sum((wp[p]*(sk[k,p]-v[p]))**2) for k in range(3))) for p in range(P)])/nu
    o['fspread']=np.array([np.sqrt(sum(w[k]*np.sum((wp[p]*(onehot.T[p]@m.F[cor[k]]-orders[p]))**2) for k in range(3))) for p in range(P)])/nf
    h=np.linalg.norm(d)/m.meta['depth']
    o['comp']=w@m.lcomp[cor]+h*(w@m.comp[cor]); o['h']=h
    pade=1.6*max(o['dv%d'%P],o['df%d'%P]); poly=1.25*o['poly']
    o['trunc']=np.sqrt(pade*min(pade,poly)); o['est_f']=o['trunc']+1.25*.5*o['cor']; o['est_s']=o['est_f']+o['comp']
    # pole info
    D=1/W[P][0] if W[P][0]!=0 else 0
    size1=np.linalg.norm(v,axis=1); uu=v/size1[:,None]; c=np.linalg.solve(uu[:-1]@uu[:-1].T+1e-3*np.eye(P-1),-uu[:-1]@uu[-1])
    o['res']=np.linalg.norm(c@uu[:-1]+uu[-1]); s=np.cumsum([1.0,*(c*size1[-1]/size1[:-1])[::-1]]); o['D']=s[-1]
    o['wmin']=w.min(); o['wmax']=w.max(); o['inc']=ew.sum(); o['t']=t; o['cw']=w; o['cor_idx']=cor
    return o
def load(which,k):
    m=M(f'/tmp/trust/{which}{k}.viscera'); rows=pickle.load(open(f'/tmp/trust/{which}{k}.pkl','rb'))
    return m,rows,[features(m,r) for r in rows]
def altforce(m,row):
    """force of orders 2,3 interpolated at the corners' own displacements"""
    t,w=m.locate(row.point); cor=m.tri[t]; ed=m.te[t]; P=m.P; d=row.push
    ew=np.array([w[0]*w[1],w[1]*w[2],w[2]*w[0]]); prs=[(0,1),(1,2),(2,0)]
    C=sum(w[k]**2*m.C[cor[k]]+ew[k]*(m.X[ed[k]]+m.X[ed[k]].T) for k in range(3)); K=np.linalg.inv(C); f=K@d
    Ca=[m.C[c] for c in cor]; Ce=[.25*(m.C[cor[i]]+m.C[cor[j]]+m.X[ed[k]]+m.X[ed[k]].T) for k,(i,j) in enumerate(prs)]
    mon=lambda x: np.prod(x**m.exp,axis=1); oh=m.deg[:,None]==np.arange(1,P+1)
    N=np.array([w*(2*w-1) if p<m.Q else w for p in range(P)]); NE=np.array([4*ew if p<m.Q else 0*ew for p in range(P)])
    r=[]
    for own in (False,True):
        fa=[(oh*mon(c@f if own else d)[:,None]).T@m.F[k] for c,k in zip(Ca,cor)]
        fe=[(oh[3:3+m.et]*mon(c@f if own else d)[3:3+m.et,None]).T@m.EF[e] for c,e in zip(Ce,ed)]
        r.append(np.array([sum(N[p,k]*fa[k][p]+NE[p,k]*fe[k][p] for k in range(3)) for p in range(P)]))
        r.append(np.array([sum(w[k]*fa[k][p] for k in range(3)) for p in range(P)]))
    r=[x/1 for x in r]; return r
