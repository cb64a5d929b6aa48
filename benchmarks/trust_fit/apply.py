"""the final formula, any order, out of sample"""
from feat import *
import os,sys,glob
def final(m,f,sh,tr=.6,ti=(2.0,2.8),cc=.25,kl=4.):
    P=m.P; D4=np.hypot(f['dv%d'%P],f['df%d'%P]); z=f['size'][-1]/f['size'][0]
    T=tr*np.sqrt(z*D4); S=I_of(m,f['spread'],f['cor'],cc,kl)
    ef=T+ti[0]*sh[0]*S; es=np.hypot(T+ti[1]*sh[1]*S,f['comp']); return ef,es
def I_of(m,sp,cor,cc=.25,kl=4.):
    P=m.P; s=0
    for p in range(2,P+1): s=s+(1. if p<=m.Q else kl)*sp[p-1]
    return s+cc*cor
if __name__=='__main__':
    which=sys.argv[1]; tot=[]
    for k in map(int,sys.argv[2].split(',')):
        m,rows,fs=load(which,k); C=pickle.load(open(f'/tmp/trust/{which}{k}.cal','rb')); sel=C['share']>.3
        S=I_of(m,[C[f's{p+1}'][sel] for p in range(m.P)],C['cor'][sel]); sh=[np.sqrt(np.mean((C['int_'+q][sel]/S)**2)) for q in 'fs']
        R=[]
        for r,f in zip(rows,fs):
            ef,es=final(m,f,sh); R.append((ef,es,r.force_error,r.shape_error,r.allowance,r.is_stable,r.depth,r.is_force_trusted and r.is_shape_trusted))
        R=np.array(R); tot.append(R); err=R[:,2:4].max(1); e=R[:,:2].max(1); t=e<=R[:,4]; right=(err<=R[:,4])&(R[:,5]>0); old=R[:,7]>0
        print(k,'order',m.P,'share',np.round(sh,3),'trusted',t.sum(),'of',len(t),'beyond',(t&(err>R[:,4])).sum(),'worst',round(max((err/R[:,4])[t],default=0),2),f"untrusted {np.mean(~t[right]):.0%} e/e {np.median(e/err):.1f} | today trusted {old.sum()} beyond {(old&(err>R[:,4])).sum()} worst {max((err/R[:,4])[old],default=0):.2f} untrusted {np.mean(~old[right]):.0%}")
        for i in np.flatnonzero(t&(err>R[:,4]))[:6]: print('    ',R[i].round(4), {n:np.round(fs[i][n],4) for n in ('dv%d'%m.P,'df%d'%m.P,'size','spread','cor','wmax','D')})
