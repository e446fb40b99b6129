import { createRequire } from "node:module";
const H="./";
const { browser, open } = await import(H+"browser.mjs");
const { serve } = await import(H+"server.mjs");
const [dir="dist", runs="2"]=process.argv.slice(2);
for (let r=0;r<+runs;r++){
  const served=await serve(dir); const {context,close}=await browser({width:640,height:480});
  await context.addInitScript(()=>{
    window.marks=[]; const W=window.Worker; window.Worker=class extends W{ constructor(...a){super(...a); this.addEventListener("message",e=>{ if(typeof e.data==="string") window.marks.push([performance.now(),"text",e.data]); else { const v=new DataView(e.data); window.marks.push([performance.now(), v.getUint8(1), e.data.byteLength]); } });} };
    let last=performance.now(); window.rafs=[]; const f=(t)=>{window.rafs.push(performance.now()); requestAnimationFrame(f)}; requestAnimationFrame(f);
  });
  const page=await context.newPage(); await page.goto(served.url);
  await page.waitForFunction(()=>window.selvedge?.stage.trackCount>0);
  const each=await page.evaluate(async()=>{ const began=performance.now(),found=[]; for(let last;performance.now()-began<3500;await new Promise(d=>setTimeout(d,30))){const {kept,frame_rate}=window.selvedge.state; if(kept!==last)found.push((kept*frame_rate).toFixed(1)); last=kept;} return found.join(" ");});
  const {marks,rafs}=await page.evaluate(()=>({marks,rafs}));
  const kinds={}; marks.forEach(m=>kinds[m[1]]=(kinds[m[1]]??0)+1);
  const big=marks.filter(m=>m[2]>9000); // cloth and frames
  console.log("each", each, "kinds", JSON.stringify(kinds));
  const t0=big[0]?.[0];
  console.log(" first big at", t0?.toFixed(0), "frames at +", big.slice(0,70).map(m=>(m[0]-t0).toFixed(0)).join(" "));
  console.log(" rafs +", rafs.filter(x=>x>t0-300&&x<t0+1600).map(x=>(x-t0).toFixed(0)).join(" "));
  await close(); await served.stop();
}
