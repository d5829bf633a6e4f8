// What the page says by itself: what it does now, and what went wrong.

import { button, element } from "./element.js";

const status = element("p", { className: "status", attributes: { role: "status" } });
const alerts = element("div", { className: "alerts", attributes: { role: "alert" } });

/** Puts both into the page. */
export function showMessages(host) {
  host.append(status, alerts);
}

/** Says what is done, or was. */
export function say(text) {
  status.textContent = text;
}

/** Says what went wrong, until it is dismissed or something else is asked. */
export function complain(...content) {
  const notice = element("div", { className: "verdict bad notice" }, element("div", {}, ...content));
  notice.append(button("Dismiss", () => notice.remove()));
  alerts.append(notice);
}

/** Takes back what was complained of. */
export function forgive() {
  alerts.replaceChildren();
}
