//! LOCAL ONLY
#![allow(missing_docs)]
use crate::sphere::Equirect;
use serde::{Serialize,Deserialize};
use burn::tensor::{Tensor,Device,TensorData};
use crate::vae::Posterior;
#[derive(Debug,Clone)]
pub struct Stripes { t: usize, p: usize }
impl Stripes {
    pub fn new(t:usize,p:usize)->Self{Self{t,p}}
    fn sizes(&self)->(usize,usize){ let m=self.t*self.p; let h=((m/2) as f64).sqrt().round() as usize; assert_eq!(2*h*h,m); (2*h,h)}
    fn each(&self,yaw:f64,mut f:impl FnMut(f64,f64)){
        let (w,h)=self.sizes(); let per=w/self.t;
        for t in 0..self.t { for a in 0..per { for b in 0..h {
            let az=std::f64::consts::TAU*((t*per+a) as f64+0.5)/w as f64+yaw; let z=1.0-2.0*(b as f64+0.5)/h as f64; f(az,z);
        }}}
    }
    pub fn directions(&self,yaw:f64)->Vec<[f32;3]>{ let mut o=vec![]; self.each(yaw,|az,z|{let r=(1.0-z*z).sqrt(); o.push([(r*az.cos()) as f32,(r*az.sin()) as f32,z as f32]);}); o}
    pub fn sample(&self,g:Equirect,img:&[f32],yaw:f64)->Vec<f32>{ let mut o=vec![]; self.each(yaw,|az,z|{
        let turns=0.5-az/std::f64::consts::TAU; let x=(turns-turns.floor())*g.width as f64-0.5; let y=(z.acos()/std::f64::consts::PI*g.height as f64-0.5).clamp(0.0,(g.height-1) as f64);
        let x0=x.floor(); let fx=(x-x0) as f32; let x0=x0.rem_euclid(g.width as f64) as usize%g.width; let x1=(x0+1)%g.width; let y0=(y as usize).min(g.height-2); let fy=(y-y0 as f64) as f32;
        for c in 0..3 { let p=|x:usize,y:usize| img[3*(y*g.width+x)+c]; let a=p(x0,y0)*(1.0-fx)+p(x1,y0)*fx; let b=p(x0,y0+1)*(1.0-fx)+p(x1,y0+1)*fx; o.push(a*(1.0-fy)+b*fy);} }); o}
}
#[derive(Clone,Debug,PartialEq,Serialize,Deserialize)]
pub struct LossConfig { pub cosine:f64,pub scale_invariant:f64,pub mse:f64,pub mage:f64,pub kld:f64 }
#[derive(Clone,Debug,PartialEq,Serialize,Deserialize)]
pub struct Schedule { pub warmup:u64, pub end:u64, pub floor:f64 }
impl Schedule { pub fn factor(&self,t:u64)->f64{ if t<self.warmup {t as f64/self.warmup as f64} else {self.floor+(1.0-self.floor)*0.5*(1.0+(std::f64::consts::PI*(t-self.warmup) as f64/(self.end-self.warmup) as f64).cos())}}}
pub fn weights(h:usize,device:&Device)->Tensor<4>{ let w:Vec<f32>=(0..h).map(|j|(std::f64::consts::PI*(j as f64+0.5)/h as f64).sin() as f32).collect(); let s:f32=w.iter().sum::<f32>()/h as f32; Tensor::from_data(TensorData::new(w.iter().map(|x|x/s).collect::<Vec<f32>>(),[1,h,1,1]),device)}
pub fn losses(c:&LossConfig,p:Tensor<4>,t:Tensor<4>,post:&Posterior,device:&Device)->(Tensor<1>,Vec<(&'static str,Tensor<1>)>){
    let [_b,h,w,_]=p.dims(); let wt=weights(h,device); let d=(p.clone()-t.clone())*1.0;
    let mse=(d.clone()*d.clone()*wt.clone()).mean();
    let m=(d.clone()*wt.clone()).mean_dim(1).mean_dim(2);
    let si=(d.clone()*d.clone()*wt.clone()).mean_dim(1).mean_dim(2)-m.clone()*m; let si=si.mean();
    let dot=(p.clone()*t.clone()).sum_dim(3); let n=((p.clone()*p.clone()).sum_dim(3)+1e-6).sqrt()*((t.clone()*t.clone()).sum_dim(3)+1e-6).sqrt();
    let cos=((dot/n).neg().add_scalar(1.0)*wt.clone()).mean();
    let mut mage=Tensor::<1>::zeros([1],device);
    let (mut a,mut cw)=(d,wt.expand([1,h,w,1])); 
    for s in 0..2 { let [_,h,w,_]=a.dims();
        let nx=|x:&Tensor<4>,dy:usize,dx:usize| x.clone().slice([0..x.dims()[0],dy..h-2+dy,dx..w-2+dx,0..3]);
        let gx=(nx(&a,0,2)-nx(&a,0,0)+nx(&a,2,2)-nx(&a,2,0))*3.0+(nx(&a,1,2)-nx(&a,1,0))*10.0;
        let gy=(nx(&a,2,0)-nx(&a,0,0)+nx(&a,2,2)-nx(&a,0,2))*3.0+(nx(&a,2,1)-nx(&a,0,1))*10.0;
        let wc=cw.clone().slice([0..1,1..h-1,1..w-1,0..1]);
        mage=mage+((gx.abs()+gy.abs())*wc).mean()*0.25;
        if s==0 { a=a.slice_dim(1,burn::tensor::s![..;2]).slice_dim(2,burn::tensor::s![..;2]); cw=cw.slice_dim(1,burn::tensor::s![..;2]).slice_dim(2,burn::tensor::s![..;2]); }
    }
    let kld=post.kld().unwrap().mean();
    let total=cos.clone()*c.cosine+si.clone()*c.scale_invariant+mse.clone()*c.mse+mage.clone()*c.mage+kld.clone()*c.kld;
    (total,vec![("cosine",cos),("scale_invariant",si),("mse",mse),("gradient",mage),("kld",kld)])
}
pub fn metrics(_g:Equirect,p:&[f32],t:&[f32])->crate::eval::reconstruction::Scores{
    let (mut a,mut b)=(0.0f64,0.0f64); for (p,t) in p.iter().zip(t){a+=(*p as f64)*(*t as f64); b+=(*p as f64)*(*p as f64);} let k=a/b;
    let pe:Vec<f32>=p.iter().map(|v|((*v as f64)*k).exp() as f32).collect(); let te:Vec<f32>=t.iter().map(|v|v.exp()).collect();
    let mse=|a:&[f32],b:&[f32]| a.iter().zip(b).map(|(a,b)|((*a-*b) as f64).powi(2)).sum::<f64>()/a.len() as f64;
    let psnr=|a:&[f32],b:&[f32]|{ let r=b.iter().cloned().fold(0.0f32,f32::max) as f64; 20.0*r.log10()-10.0*mse(a,b).log10()};
    let (pl,_)=crate::panorama::tonemap::srgb_q98(&pe); let (tl,_)=crate::panorama::tonemap::srgb_q98(&te);
    crate::eval::reconstruction::Scores{ldr_psnr:psnr(&pl,&tl),hdr_psnr:psnr(&pe,&te),ssim:0.0}
}
