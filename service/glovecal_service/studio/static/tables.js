// On a narrow page each row of a table is a card whose cells name their own columns, and the pages of the studio
// are one line that scrolls (studio.css). What an address names after "#" is there only after the page was loaded.
const AT_LEAST_MS = 300;

let aim = location.hash.slice(1);

function name() {
  const wanted = aim && document.getElementById(aim);
  if (wanted) { aim = ""; wanted.scrollIntoView(); }
  for (const table of document.querySelectorAll("#main table")) {
    const heads = [...table.querySelectorAll("thead th")].map(head => head.textContent);
    for (const row of table.querySelectorAll("tbody tr"))
      [...row.children].forEach((cell, at) => {
        if (heads[at] !== undefined && cell.dataset.head !== heads[at]) cell.dataset.head = heads[at];
      });
  }
}

let waiting = 0;
const again = () => { waiting ||= setTimeout(() => { waiting = 0; name(); }, AT_LEAST_MS); };
new MutationObserver(again).observe(document.body, { childList: true, subtree: true });
again();

function showPage() {
  const here = document.querySelector(".studio-nav [aria-current]");
  if (!here) return;
  // not scrollIntoView: browsers (Chromium 150) go on from there with Tab, past the link to the content
  const nav = here.closest(".studio-nav"), [row, link] = [nav, here].map((item) => item.getBoundingClientRect());
  nav.scrollLeft += link.left + link.width / 2 - row.left - row.width / 2;
}

addEventListener("load", showPage);
addEventListener("resize", showPage);
showPage();
