import { browser, open } from "./browser.mjs"; import { serve } from "./server.mjs";
const served=await serve("/tmp/f8/dist-b"); const errors=[];
for (const [n,size,t] of [["page",{width:1360,height:850},false],["phone",{width:390,height:844},true]]) { const {context,close}=await browser(size,{hasTouch:t}); const page=await open(context,served.url,errors); await page.waitForFunction(()=>window.selvedge.stage.frame?.time>2.5,null,{timeout:120000}); await page.screenshot({path:`/tmp/f8/static-${n}.png`}); await close(); }
console.log(errors); await served.stop();
