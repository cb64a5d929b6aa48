from apply import *
ks=sorted(int(os.path.basename(p)[6:-4]) for p in glob.glob('/tmp/trust/tuning*.cal'))
try: DATA=pickle.load(open('/tmp/trust/data.pkl','rb'))
except Exception:
    DATA={}
    for k in ks:
        m,rows,fs=load('tuning',k); DATA[k]=(m.P,m.Q,[(r.force_error,r.shape_error,r.allowance,r.is_stable,r.depth,r.is_force_trusted and r.is_shape_trusted) for r in rows],fs,pickle.load(open(f'/tmp/trust/tuning{k}.cal','rb')))
    pickle.dump(DATA,open('/tmp/trust/data.pkl','wb'))
def ev(tag,disf,diss,tr=.6,ti=(2.0,2.8),stat=lambda r: np.sqrt(np.mean(r**2)),mult=(1.,),hyp=True,verbose=False):
    R=[]
    for k,(P,Q,rows,fs,C) in DATA.items():
        sel=C['share']>.3; Cs={n:v[sel] for n,v in C.items()}
        sh=[stat(Cs['int_'+q]/np.maximum(dis(P,Q,[Cs[f's{p+1}'] for p in range(P)],[Cs[f'g{p+1}'] for p in range(P)],Cs['cor']),1e-9)) for q,dis in (('f',disf),('s',diss))]
        sp=np.array([f['spread'] for f in fs]).T; fg=np.array([f['fspread'] for f in fs]).T; cor=np.array([f['cor'] for f in fs]); z=np.array([f['size'][-1]/f['size'][0] for f in fs]); D4=np.array([np.hypot(f['dv%d'%P],f['df%d'%P]) for f in fs]); comp=np.array([f['comp'] for f in fs])
        T=tr*np.sqrt(z*D4); jf=ti[0]*sh[0]*disf(P,Q,sp,fg,cor); js=ti[1]*sh[1]*diss(P,Q,sp,fg,cor)
        R.append(np.column_stack([T,jf,js,comp,np.array(rows,float),np.full(len(rows),k)]))
    R=np.concatenate(R)
    for g in mult:
        ef=g*(R[:,0]+R[:,1]); es=np.hypot(g*(R[:,0]+R[:,2]),R[:,3]); err=R[:,4:6].max(1); A=R[:,6]; e=np.maximum(ef,es); t=e<=A; right=(err<=A)&(R[:,7]>0); NH=np.isin(R[:,-1],[0,2,4,5,7,9,11,12,13,14,18,19]); b=t&(err>A)
        print(f"{tag:20s} g {g:.2f} trusted {t.sum()} beyond {b.sum()} ({1e3*b.sum()/t.sum():.1f}/1000) worst {(err/A)[t].max():.2f} twice {(t&(err>2*A)).sum()} untrusted {np.mean(~t[right]):.1%} NH {np.mean(~t[right&NH]):.1%} e/e {np.median(e/err):.2f}", [(int(k),round(float((err/A)[i]),2)) for i,k in zip(np.flatnonzero(b),R[b,-1])] )
    return R
S=lambda P,Q,s,g,cor,cc=.25,kl=4.,cg=0.: sum((1. if p<=Q else kl)*(s[p-1]+cg*g[p-1]) for p in range(2,P+1))+cc*cor
if __name__=='__main__':
    old=np.concatenate([np.array(d[2],float) for d in DATA.values()]); err=old[:,:2].max(1); A=old[:,2]; t=old[:,5]>0; right=(err<=A)&(old[:,3]>0); print('today trusted',t.sum(),'beyond',(t&(err>A)).sum(),'twice',(t&(err>2*A)).sum(),f"untrusted {np.mean(~t[right]):.1%}")
    m=(.8,.9,1.,1.1,1.2)
    ev('now',S,S,mult=m)
    for cg in (.3,1.):
        ev(f'force cg {cg}',lambda *a: S(*a,cg=cg),S,mult=(.8,.9,1.,1.1))
        ev(f'both cg {cg}',lambda *a: S(*a,cg=cg),lambda *a: S(*a,cg=cg),mult=(.8,.9,1.,1.1))
    ev('cc .5',lambda *a: S(*a,cc=.5),lambda *a: S(*a,cc=.5),mult=(.8,.9,1.,1.1))
    ev('cc 1 force',lambda *a: S(*a,cc=1.),lambda *a: S(*a,cc=.25),mult=(.8,.9,1.,1.1))
    mx=lambda r: np.quantile(r,.9)
    ev('q90',S,S,ti=(1.4,2.0),stat=mx,mult=(.8,.9,1.,1.1,1.2))
    ev('trunc .8',S,S,tr=.8,mult=(.8,.9,1.,1.1))
    ev('trunc .8 int lower',S,S,tr=.8,ti=(2.,2.3),mult=(.8,.9,1.,1.1,1.2))
    ev('trunc .5 int 2.6 2.8',S,S,tr=.5,ti=(2.6,2.8),mult=(.8,.9,1.,1.1,1.2))
