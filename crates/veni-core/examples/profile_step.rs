//! profile
use std::time::Instant;
use veni_core::data::*; use veni_core::train::{batch::*,presets::*,optimiser::*,loss::Loss,step::*}; use veni_core::vae::Veni;
use rand::SeedableRng;
#[global_allocator]
static A: mimalloc::MiMalloc = mimalloc::MiMalloc;
fn main(){
    let mut a=std::env::args().skip(1); let data=a.next().unwrap(); let sets:Vec<String>=a.collect();
    let mut c=Preset::Small.config(9).with_overrides(&sets).unwrap(); c.data.folders=vec![data.into()]; c.check().unwrap();
    let t=Instant::now(); let s=Splits::open(&c.data,0).unwrap(); println!("load {} + {} in {:?}",s.train.len(),s.val.len(),t.elapsed());
    let dev=c.device.device().unwrap().autodiff();
    
    let mut veni=Veni::new(&c.model,&mut rand_chacha::ChaCha8Rng::seed_from_u64(0),&dev).unwrap();
    let g=|p:&str|Group{prefix:p.into(),adam:c.decoder.adam};
    let mut opt=Optimiser::new(&veni,vec![g("decoder"),g("encoder")],0.999).unwrap();
    let k=c.loss_grid.factor(); let loss=Loss::new(&c.loss,64/k,128/k,&dev); let b=Batches::new(&c,veni.stripes().unwrap(),&s.train);
    let mut sum=[0.0;4]; let n:u64=std::env::var("N").map_or(6,|v|v.parse().unwrap());
    for step in 1..=n { let t=Instant::now(); let batch=b.prepare(step); let t0=t.elapsed().as_secs_f64();
        let t=Instant::now(); let l=batch_loss(&veni,&batch,&loss,&dev); let total=l.terms.total(); let t1=t.elapsed().as_secs_f64();
        let t=Instant::now(); let gr=total.backward(); let t2=t.elapsed().as_secs_f64();
        let t=Instant::now(); let lr=[c.decoder.learning_rate.at(step),c.encoder.learning_rate.at(step)]; let r; (veni,r)=opt.step(veni,&gr,&lr); let t3=t.elapsed().as_secs_f64();
        if step>1 {for (s,t) in sum.iter_mut().zip([t0,t1,t2,t3]) {*s+=t/(n-1) as f64;}}
        let tot:f32=total.into_scalar(); if step<6||step%20==0 {println!("{step} loss {tot:.4} norms {:.3} {:.3}",r[0].gradient_norm,r[1].gradient_norm);}
    }
    println!("prepare {:.1} forward {:.1} backward {:.1} adam {:.1} ms",sum[0]*1e3,sum[1]*1e3,sum[2]*1e3,sum[3]*1e3);
}
