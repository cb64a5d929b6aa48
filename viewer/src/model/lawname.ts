// Laws as they are written: by the names of model files, and by those of Python.
const NAMES: Record<string, string> = {
  neo_hookean: "neo-Hookean",
  mooney_rivlin: "Mooney-Rivlin",
  saint_venant_kirchhoff: "Saint Venant-Kirchhoff",
  linear: "linear elasticity",
  corotated: "corotated elasticity",
  HolzapfelGasserOgden: "Holzapfel-Gasser-Ogden",
  MooneyRivlin: "Mooney-Rivlin",
  NeoHookean: "neo-Hookean",
  SaintVenantKirchhoff: "Saint Venant-Kirchhoff",
  Several: "several laws",
};

export function lawName(law: string): string {
  return NAMES[law] ?? law;
}
