"""scratch"""
from dataclasses import dataclass
from sim_ecu.loop.control.consumer import Adhesion, AdhesionReceiver

CYCLE_S=0.01
@dataclass(frozen=True)
class P:
    share: float=0.92
    k: float=0.3
    fast: float=10.0     # 1/s
    rise: float=60e3
    fall: float=180e3
    lag: float=0.05
    c_f: float=0.004
    c_k: float=0.016
    slow: float=0.15
    down: float=1.5
    floor: float=0.85
    lift: float=40e3
    t_fast: float=2.0
    t_share: float=0.85

class AdhesionLimit:
    def __init__(self, receiver: AdhesionReceiver, unit_N_m: float, p: P=P()):
        self.r, self.unit, self.p = receiver, unit_N_m, p
        self.L=None; self.M=0.0; self.was_low=True; self.log=None
    def hear(self, can_id, data, stamp_us): self.r.hear(can_id,data,stamp_us)
    def limit(self, now_us, asked, given, creep, sliding, braking):
        p=self.p; dt=CYCLE_S
        # what the drive makes of what was asked of it
        d=(given-self.M)/p.lag; self.M+=min(max(d,-p.fall),p.rise)*dt
        a=self.r.adhesion(now_us)
        if a is None:
            if self.L is not None:
                self.L+=p.lift*dt
                if self.L>=asked: self.L=None
            return self.L
        if a.half_width is None: return self.L
        cap=self.unit*max(a.mu-p.k*a.half_width,0.5*a.mu,0)*(p.share if braking else p.t_share)
        self.cap=cap
        if asked<=cap or self.L is None:
            self.L=max(cap, self.M if (self.L is None and creep<p.c_k and not sliding) else 0)
            return self.L
        L=self.L
        if sliding: L=min(L,cap)
        elif creep>p.c_k:
            L=max(L-p.down*L*min(creep/p.c_k-1,1)*dt, min(L,p.floor*cap))
            if L>cap: L=max(cap, L-p.fall*dt)
        elif creep<p.c_f:
            if L<cap: L=min(cap,L+p.rise*dt)
            elif self.M>0.9*L-300: L+=min((p.fast if braking else p.t_fast)*L,p.rise)*dt
        else:
            L+=p.slow*L*(1-creep/p.c_k)*dt
        self.L=max(min(L,asked*1.02),0.0)
        return self.L
