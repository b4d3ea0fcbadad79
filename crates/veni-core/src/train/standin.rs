//! LOCAL ONLY
#![allow(missing_docs)]
use crate::sphere::Equirect;
pub fn metrics(_g:Equirect,p:&[f32],t:&[f32])->crate::eval::reconstruction::Scores{
    let (mut a,mut b)=(0.0f64,0.0f64); for (p,t) in p.iter().zip(t){a+=(*p as f64)*(*t as f64); b+=(*p as f64)*(*p as f64);} let k=a/b;
    let pe:Vec<f32>=p.iter().map(|v|((*v as f64)*k).exp() as f32).collect(); let te:Vec<f32>=t.iter().map(|v|v.exp()).collect();
    let mse=|a:&[f32],b:&[f32]| a.iter().zip(b).map(|(a,b)|((*a-*b) as f64).powi(2)).sum::<f64>()/a.len() as f64;
    let psnr=|a:&[f32],b:&[f32]|{ let r=b.iter().cloned().fold(0.0f32,f32::max) as f64; 20.0*r.log10()-10.0*mse(a,b).log10()};
    let (pl,_)=crate::panorama::tonemap::srgb_q98(&pe); let (tl,_)=crate::panorama::tonemap::srgb_q98(&te);
    crate::eval::reconstruction::Scores{ldr_psnr:psnr(&pl,&tl),hdr_psnr:psnr(&pe,&te),ssim:0.0}
}
