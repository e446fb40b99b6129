import { build } from "esbuild"; import { mkdirSync, writeFileSync, readFileSync } from "node:fs"; import { basename, join, resolve } from "node:path";
import { browser } from "./browser.mjs"; import { serve } from "./server.mjs";
const page="/tmp/f8/capepage"; mkdirSync(page,{recursive:true});
const src=process.argv[2]??"npm/cape.js", runs=+(process.argv[3]??1), drawn=!process.env.UNDRAWN;
await build({entryPoints:[src],bundle:true,format:"esm",target:"es2022",alias:{selvedge:resolve("dist-npm/index.js")},nodePaths:["node_modules"],outfile:join(page,"example.js"),logLevel:"error"});
for(const f of ["dist-npm/selvedge_web_bg.wasm","npm/cape.toml","../assets/bodies/mannequin.glb"]) writeFileSync(join(page,basename(f)),readFileSync(f));
writeFileSync(join(page,"index.html"),'<!doctype html><title>cloth</title><body style="margin: 0"><script type="module" src="example.js"></script>');
const mins=[];for(let r=0;r<runs;r++){ const served=await serve(page); const c=await browser({width:480,height:320}); const s=await c.context.newPage(); await s.goto(served.url+"#still"); await s.waitForFunction(()=>globalThis.report?.ready,null,{timeout:120000});
const m=await s.evaluate((d)=>{ const t0=performance.now(); for(let k=0;k<600;k++) report.move(k===350?1:k%100===50?0.1:1/60,d); return {all:performance.now()-t0,times:report.times,problems:report.problems}; },drawn);
const t=m.times.map((x,k)=>[k,x]).filter(([k])=>k!==350&&k%100!==50); const mean=t.reduce((a,x)=>a+x[1],0)/t.length; const top=t.toSorted((a,b)=>b[1]-a[1]).slice(0,8);
console.log(`mean ${mean.toFixed(2)} worst ${top.map(([k,x])=>k+":"+x.toFixed(1)).join(" ")} wall ${(m.all/1000).toFixed(1)} s`, m.problems); m.times.forEach((x,k)=>mins[k]=Math.min(mins[k]??1e9,x)); await c.close(); await served.stop(); }
const q=mins.map((x,k)=>[k,x]).filter(([k])=>k!==350&&k%100!==50).toSorted((a,b)=>b[1]-a[1]).slice(0,6); console.log("least of all runs: worst frames", q.map(([k,x])=>k+":"+x.toFixed(1)).join(" "));
